"""The benchmark's problems: hopopt's part meets the known optima, and those are what they say."""

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

SCRIPTS = Path(__file__).parents[1] / "benchmarks"
ACCURACY = {
    "effort": 1e-9,
    "denham": 1e-6,
    "arm": 3e-4,
    "jump": 1e-6,
    "rail": 4e-4,
    "hop": 2e-3,
}  # bang-bang in 20 intervals: smeared


@pytest.fixture(scope="module")
def scripts() -> dict[str, ModuleType]:
    """The scripts as modules, imported as they import each other."""
    folders = [str(SCRIPTS), str(SCRIPTS / "peers")]
    sys.path[:0] = folders
    try:
        import casadi_ways  # pyright: ignore[reportMissingImports]
        import in_hopopt  # pyright: ignore[reportMissingImports]
        import mesh_size  # pyright: ignore[reportMissingImports]
        import posed  # pyright: ignore[reportMissingImports]
        import random_legs  # pyright: ignore[reportMissingImports]
        import store_hop  # pyright: ignore[reportMissingImports]
        import warm  # pyright: ignore[reportMissingImports]
    finally:
        sys.path[:2] = []
    return {m.__name__: m for m in (casadi_ways, in_hopopt, mesh_size, posed, random_legs, store_hop, warm)}


@pytest.fixture(scope="module")
def hop_folder(scripts: dict[str, ModuleType], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The hop, stored for other packages."""
    folder = tmp_path_factory.mktemp("hop")
    scripts["store_hop"].store(folder)
    return folder


@pytest.mark.parametrize("name", ACCURACY)
def test_hopopt_meets_the_known_optimum(name: str, scripts: dict[str, ModuleType], hop_folder: Path) -> None:
    posed = scripts["posed"].posed(name, hop_folder)
    found = scripts["in_hopopt"].run(posed)
    assert found.status == "Solve_Succeeded"
    assert found.objective == pytest.approx(posed.optimum, rel=ACCURACY[name])


def test_the_stored_hop_is_the_hop_of_the_planner(scripts: dict[str, ModuleType], hop_folder: Path) -> None:
    """The same program, whether posed through the planner's own classes or from the stored formulas."""
    import hopopt as ho
    from hopopt.nlp.solver.ipopt import NlpSolver
    from hopopt.ocp.guesses.initial_guess import NAMED_STARTS, make_guess
    from hopopt.ocp.hop import Hop
    from hopopt.planner.search.multistart import first_transcription

    hop = Hop(ho.load("paper"))
    own = NlpSolver(first_transcription(hop))(make_guess(hop, NAMED_STARTS[0]))
    stored = scripts["in_hopopt"].run(scripts["posed"].posed("hop", hop_folder))
    assert -stored.objective == pytest.approx(own.objective, abs=1e-6)


def test_arm_is_fastest_with_three_switches(scripts: dict[str, ModuleType]) -> None:
    """The minimum time by shooting: three switching times and the end time meet the four end conditions."""
    posed = scripts["posed"]
    first, last = (np.array(pairs)[:, 0] for pairs in (posed.arm().phases[0].start, posed.arm().phases[0].end))

    def missed(times: np.ndarray) -> np.ndarray:
        x, began = first, 0.0
        for end, u in zip(times, [(1, 1), (1, -1), (-1, -1), (-1, 1)], strict=True):
            run = solve_ivp(
                lambda _, y, u=u: posed.arm_rates(y, u, np), (began, end), x, "DOP853", rtol=1e-12, atol=1e-13
            )
            x, began = run.y[:, -1], end
        return x - last

    found = root(missed, [0.94, 1.49, 2.63, 2.98], tol=1e-12)
    assert np.abs(missed(found.x)).max() < 1e-10
    assert found.x[-1] == pytest.approx(posed.arm().optimum, abs=1e-8)


def test_full_force_is_the_best_jump(scripts: dict[str, ModuleType]) -> None:
    """The closed form against an integration of full force."""
    p = scripts["posed"]

    def stroke(_: float, y: np.ndarray) -> float:
        return y[0] - p.STROKE

    stroke.terminal = True  # type: ignore[attr-defined]
    push = solve_ivp(
        lambda _, y: [y[1], p.FORCE / p.MASS * (1 - y[1] / p.SPEED) - p.GRAVITY],
        (0.0, 1.0), [0.0, 0.0], events=stroke, rtol=1e-11, atol=1e-12,
    )  # fmt: skip
    assert p.HASTE * push.t[-1] - push.y[1, -1] == pytest.approx(p.jump_optimum(), abs=1e-8)


@pytest.mark.parametrize("phase", [0, 1], ids=["stance", "flight"])
def test_the_leg_posed_by_hand_moves_by_its_energies(phase: int, scripts: dict[str, ModuleType]) -> None:
    """Its rates against Lagrange's equations of three bodies and two rotors, the centre of mass a coordinate of its own."""
    import casadi as ca

    p = scripts["posed"]
    q, v = ca.SX.sym("q", 3), ca.SX.sym("v", 3)  # hip's height, thigh, shank; in stance the foot on the ground
    knee = ca.vertcat(p.LINK * ca.sin(q[1]), q[0] - p.LINK * ca.cos(q[1]))
    places = (
        (p.BODY, ca.vertcat(0, q[0])),
        (p.THIGH, (ca.vertcat(0, q[0]) + knee) / 2),
        (p.SHANK, knee + p.LINK / 2 * ca.vertcat(ca.sin(q[2]), -ca.cos(q[2]))),
    )
    moving = sum(m / 2 * ca.sumsqr(ca.jtimes(place, q, v)) for m, place in places)
    turning = p.ROD / 2 * (p.THIGH * v[1] ** 2 + p.SHANK * v[2] ** 2) + p.ROTOR / 2 * (v[1] ** 2 + (v[2] - v[1]) ** 2)
    energy, height = moving + turning, sum(m * place[1] for m, place in places)
    mass = ca.hessian(energy, v)[0]
    rest = ca.jtimes(ca.gradient(energy, v), q, v) - ca.gradient(energy, q) + p.GRAVITY * ca.gradient(height, q)
    at = ca.Function("at", [q, v], [mass, rest, height / p.WHOLE, ca.jtimes(height, q, v) / p.WHOLE])
    rng, hip, bend = np.random.default_rng(0), 0.3, -0.6
    for _ in range(5):
        a, b, w, u = rng.uniform(-1, 1, 4)
        torques = p.TORQUE * np.array([0, hip - bend, bend])
        if phase == 0:
            state, place, speed = [a, w], [2 * p.LINK * np.cos(a), a, -a], [-2 * p.LINK * np.sin(a) * w, w, -w]
        else:
            place, speed = [0.9, a, b], [0.4, w, u]
            state = [a, b, w, u, 0.0, 0.0]
        matrix, forces, _, _ = (np.asarray(each).squeeze() for each in at(place, np.array(speed) * p.RATE))
        rates, path, _ = p.rail().phases[phase].at(state, [hip, bend], np)
        if phase == 1:
            found = np.array(rates[2:4]) * p.RATE
            assert found == pytest.approx(np.linalg.solve(matrix, torques - forces)[1:], rel=1e-10)
            continue
        held = np.array([-2 * p.LINK * np.sin(a), 1, -1])  # how all move with the thigh
        turn, lift = rates[1] * p.RATE, -2 * p.LINK * np.cos(a) * (w * p.RATE) ** 2
        acceleration = held * turn + [lift, 0, 0]
        left = matrix @ acceleration + forces - torques  # what the ground gives
        assert held @ left == pytest.approx(0, abs=1e-10 * np.abs(forces).max())
        assert path[-1] * p.WHOLE * p.GRAVITY == pytest.approx(left[0], rel=1e-10)


def test_mesh_size_and_warm_measure_the_same_hop(scripts: dict[str, ModuleType]) -> None:
    import hopopt as ho
    from hopopt.nlp.solver.ipopt import WARM, NlpSolver
    from hopopt.ocp.hop import Hop
    from hopopt.planner.search.multistart import first_transcription

    hop = Hop(ho.load("paper", ["solver.stance_intervals=16", "solver.flight_intervals=4"]))
    cost = scripts["mesh_size"].measured(hop, 20)
    assert cost.solution.success
    assert scripts["mesh_size"].row(20, [cost]).startswith("| 20 | 423 |")
    transcription = first_transcription(hop)
    plain, warm, asked = NlpSolver(transcription), NlpSolver(transcription, WARM), []

    class Noting(NlpSolver):
        def __call__(self, guess: Any, parameters: Any = None, *more: Any) -> Any:
            asked.append(sorted(parameters or ()))
            return super().__call__(guess, parameters, *more)

    plain.__class__ = warm.__class__ = Noting
    line = scripts["warm"].compared(hop, plain, warm, 0.1, 1, "leg.gear.ratio")
    assert line.endswith("| yes |")
    assert asked == [[], ["leg.gear.ratio"], *[["clearance", "leg.gear.ratio"]] * 2]  # "answer" and "warm": all of it


def test_a_package_that_fails_is_listed_with_its_reason() -> None:
    import runpy

    main = runpy.run_path(str(SCRIPTS / "peers.py"))
    good = {"build": 0.1, "solve": 0.1, "total": 0.2, "iterations": 5, "objective": 12.0, "status": "Solve_Succeeded"}
    found = {"hopopt": good, "slow": {**good, "total": 0.5}, "absent": {"failed": "no such package"}}
    text = main["table"]("effort", 12.0, found)
    assert "| absent | - | - | - | - | - | no such package |" in text
    assert "| slow | 0.100 | 0.100 | 0.500 | 2.5 | 5 | +0.0e+00 |" in text


@pytest.mark.parametrize("name", ["small Hessians from `ca.hessian`", "all in SX (`expand`), CasADi's derivatives"])
def test_casadis_own_ways_have_the_same_optimum(name: str, scripts: dict[str, ModuleType]) -> None:
    script = scripts["casadi_ways"]
    own, other = (script.measured(way, "paper", (8, 2)) for way in ("", name))
    assert not own["failure"]
    assert other["objective"] == pytest.approx(own["objective"], abs=1e-9)
    assert script.row(name, [own], [other], "").startswith(f"| {name} | ")


def test_a_way_that_fails_is_listed_with_its_reason(scripts: dict[str, ModuleType]) -> None:
    assert (
        scripts["casadi_ways"].row("absent", [], [], "no such library")
        == "| absent | - | - | - | - | no such library |"
    )
    late = {"failure": "Maximum_Iterations_Exceeded"}
    assert "Maximum_Iterations_Exceeded" in scripts["casadi_ways"].row("slow", [late], [late], "")


def test_random_legs_are_the_same_for_a_seed_and_end_in_words(scripts: dict[str, ModuleType]) -> None:
    """A longer list begins with the shorter one; a leg too slow to leave the ground is not solved, with a reason."""
    script = scripts["random_legs"]
    first, more = script.feasible_legs(2, 1), script.feasible_legs(4, 1)
    assert more[:2] == first
    assert more[2] != first[0]
    heavy = {**first[0], "hop.flight_duration": [1.4, 1.5], "solver.max_iterations": 60, "solver.refine": False}
    found = script.solved(0, heavy, 1)
    assert found.ended == script.NOT_SOLVED
    assert "hop.flight_duration" in found.sentence


@pytest.mark.slow
def test_a_random_leg_is_verified_below_the_bound(scripts: dict[str, ModuleType]) -> None:
    script = scripts["random_legs"]
    found = script.solved(0, script.feasible_legs(1, 1)[0], 1)
    assert found.ended == script.VERIFIED, found.sentence
    assert 0 < found.clearance < found.bound
