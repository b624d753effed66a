"""The program at hand: its expressions solved by another's hand, its dynamics by Pinocchio, its way to a verified answer."""

import subprocess
import sys
import tomllib
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import hopopt as ho
from hopopt.errors import ProblemFileError, UsageError

COARSE = {"solver.stance_intervals": 8, "solver.flight_intervals": 4}


@pytest.fixture(scope="module")
def program() -> ho.Program:
    return ho.program(ho.load("paper", COARSE))


@pytest.fixture(scope="module")
def found(program: ho.Program) -> ho.ProgramSolution:
    return program.solve()


def test_its_expressions_and_bounds_are_a_program_that_ipopt_solves_alike(
    program: ho.Program, found: ho.ProgramSolution
) -> None:
    """Made anew from what is handed out, with CasADi's own derivatives."""
    assert found.success
    parts = {"x": program.x, "p": program.p, "f": program.f, "g": program.g}
    own = ca.nlpsol(
        "own", "ipopt", parts, {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-9}
    )
    bounds = {"lbx": program.lbx, "ubx": program.ubx, "lbg": program.lbg, "ubg": program.ubg}
    again = own(x0=program.guess, p=program.parameters, **bounds)
    assert -float(again["f"]) == pytest.approx(found.objective, rel=1e-6)  # a height, made small with the other sign


def test_names_say_what_each_number_is(program: ho.Program, found: ho.ProgramSolution) -> None:
    names = program.variable_names
    assert len(set(names)) == len(names) == len(program.scale)
    assert len(set(program.row_names)) == len(program.lbg) == len(program.row_scale)
    si = dict(zip(names, found.x * program.scale, strict=True))
    assert si["clearance"] == pytest.approx(found.objective, abs=1e-4)  # but for the tie-break
    knee = found.motion.sample([0.0, si["stance duration"]]).q[:, 3]
    steps = max(int(name.split()[-1]) for name in names if name.startswith("stance q[knee]"))
    assert [si["stance q[knee] 0"], si[f"stance q[knee] {steps}"]] == pytest.approx(list(knee), abs=1e-9)
    g = np.array(ca.Function("g", [program.x, program.p], [program.g])(found.x, program.parameters)).ravel()
    foot = g[program.row_names.index("clearance[foot]")] * program.row_scale[program.row_names.index("clearance[foot]")]
    end = si["stance duration"] + si["flight duration"]
    height = found.motion.sample([end]).points["foot"][0, 1]
    assert foot == pytest.approx(height - si["clearance"], abs=1e-8)
    assert program.parameters[program.parameter_names.index("leg.gear.ratio")] == ho.load("paper").leg.gear.ratio


def test_its_derivatives_have_the_sparsity_that_is_stated(program: ho.Program) -> None:
    p = program.parameters
    jacobian = np.array(program.jacobian(program.guess, p)[1])
    step = 1e-6 * np.random.default_rng(1).normal(size=len(program.scale))
    g = ca.Function("g", [program.x, program.p], [program.g])
    change = np.array(g(program.guess + step, p) - g(program.guess - step, p)).ravel() / 2
    np.testing.assert_allclose(jacobian @ step, change, atol=1e-11)
    assert program.jacobian_sparsity.nnz() >= np.count_nonzero(jacobian)
    assert program.hessian_sparsity.size1() == len(program.scale)


def test_its_dynamics_are_those_of_pinocchio(program: ho.Program) -> None:
    q, v, a = np.random.default_rng(2).normal(size=(3, 4))
    forces = pin.rnea(program.model, program.model.createData(), q, v, a)
    np.testing.assert_allclose(np.array(program.inverse_dynamics(q, v, a)).ravel(), forces, atol=1e-11)
    states, controls = program.components("flight")
    x = dict.fromkeys(states, 0.1) | {"com_v[z]": 2.0}
    everything = [*program.parameters, 0.5]  # the last is what the clearance is
    xdot = dict(
        zip(
            states,
            np.array(program.dynamics["flight"](list(x.values()), [3.0, 4.0], 0.0, everything)).ravel(),
            strict=True,
        )
    )
    assert controls == ("a[hip]", "a[knee]")
    assert (xdot["com[z]"], xdot["v[hip]"], xdot["v[knee]"]) == (2.0, 3.0, 4.0)
    assert xdot["com_v[z]"] == pytest.approx(program.model.gravity.linear[2])


def test_ipopts_lines_are_printed_where_they_are_asked_for(
    program: ho.Program, found: ho.ProgramSolution, capfd: pytest.CaptureFixture[str]
) -> None:
    again = program.solve({"max_iter": 3}, guess=found, log=True)
    assert "inf_pr" in capfd.readouterr().out
    assert len(again.log["inf_pr"]) == again.nlp.iterations + 1 <= 4
    program.solve({"max_iter": 3})
    assert not capfd.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"nonsense": 3}, "No such IPOPT option: nonsense"),
        ({"linear_solver": "ma57"}, "linear solver other than mumps"),
    ],
)
def test_options_that_ipopt_does_not_take(program: ho.Program, options: dict[str, object], words: str) -> None:
    with pytest.raises(UsageError, match=words) as refused:
        program.solve(options)
    assert "/" not in str(refused.value)


def test_a_problem_takes_options_of_a_list() -> None:
    assert ho.load("paper", ["solver.ipopt.mu_strategy='monotone'"]).solver.options == {"ipopt.mu_strategy": "monotone"}
    for wrong in ("output_file='x'", "linear_solver='mine'", "tol=1"):
        with pytest.raises(ProblemFileError, match=r"solver\.ipopt\."):
            ho.load("paper", [f"solver.ipopt.{wrong}"])


def test_a_guess_that_does_not_fit(program: ho.Program, hop: ho.Solution) -> None:
    with pytest.raises(UsageError, match="the guess has no descent: it is a hop of stance, flight"):
        ho.solve(ho.load("paper", {"hop.kind": "periodic"}), guess=hop, starts=1, processes=1)
    with pytest.raises(UsageError, match="3 numbers where the program has"):
        program.solve(guess=np.zeros(3))


@pytest.mark.slow
def test_from_a_program_to_an_answer_that_another_process_verifies(tmp_path: Path, found: ho.ProgramSolution) -> None:
    leg = ho.load("paper", ["solver.ipopt.mu_strategy='monotone'", "leg.gear.ratio=82"])
    kept = ho.save(ho.solve(leg, guess=found, starts=1, processes=1), tmp_path)
    assert kept.verified
    assert kept.clearance == pytest.approx(
        ho.solve(ho.load("paper", ["leg.gear.ratio=82"]), starts=1).clearance, abs=1e-5
    )
    assert "the guess" in str(kept.summary.starts)
    assert kept.result_dir is not None
    stored = tomllib.loads((kept.result_dir / "problem.toml").read_text(encoding="utf-8"))
    assert stored["solver"]["ipopt"] == {"mu_strategy": "monotone"}
    words = [sys.executable, "-m", "hopopt", "verify", str(kept.result_dir)]
    assert subprocess.run(words, capture_output=True, check=False).returncode == 0
    last = ho.program(ho.read(str(kept.result_dir))).solve()
    assert last.success
    assert last.objective == pytest.approx(kept.summary.objective_value, abs=2e-5)
