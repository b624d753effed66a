"""The assembled derivatives against CasADi's own differentiation of the same nonlinear program."""

import casadi as ca
import numpy as np
import pytest

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.mesh import PhaseMesh, mesh_of_arcs, uniform
from hopopt.nlp.schemes import HERMITE_SIMPSON, TRAPEZOIDAL, Scheme, radau
from hopopt.nlp.transcription import Transcription
from hopopt.ocp.problem import (
    BoundaryConstraint,
    Control,
    Ends,
    Objective,
    Parameter,
    PathConstraint,
    Phase,
    Problem,
    State,
    linkage,
)

ARCS = mesh_of_arcs([0, 0.2, 0.5, 1], [1, 2, 2])
UNEVEN = PhaseMesh((0, 0.1, 0.4, 1.0), (1,))


def everything() -> Problem:
    """All the layer can state: time, free parameters, nonlinear use of integrals, nonlinear linkages, scales."""
    first = Phase(
        "first",
        (State("q", 2, scale=2.0), State("m", scale=0.5)),
        (Control("u", 2, scale=3.0), Control("w")),
        lambda s: {
            "q": ca.vertcat(s.q[1] * s.u[0] + ca.sin(s.t * s.p["k"][1]), s.u[1] * s.w - s.q[0] * s.p["k"][0] * s.t**2),
            "m": s.p["c"] - s.m * s.w**2,
        },
        (0.5, 2.0),
        (
            PathConstraint("a", lambda s: ca.vertcat(s.q[0] * s.u[0] * s.p["k"][0], s.t * s.m**2), -1, 1, 2.0),
            PathConstraint("b", lambda s: s.w * s.t * s.p["c"], -1, 5),
        ),
        {"e": lambda s: s.u[0] ** 2 * s.m + s.t * s.p["k"][1] ** 2, "h": lambda s: s.q[0] * s.w},
    )
    control = (Control("u"),)
    second = Phase(
        "second", (State("z"),), control, lambda s: {"z": s.u * s.p["k"][1] - s.z**3}, (0.1, 3.0),
        integrands={"g": lambda s: s.u**2 * s.z},
    )  # fmt: skip
    third = Phase("no-control", (State("z"),), (), lambda s: {"z": -s.z}, (0.1, 3.0))
    boundary = (
        linkage("nonlinear", lambda e: e.final["first"].q[0] * e.final["first"].m - e.initial["second"].z ** 2),
        linkage("linear", lambda e: e.final["second"].z - e.initial["no-control"].z),
        BoundaryConstraint("integrals", integral_rows, -1, 1, (2.0, 3.0, 4.0)),
    )
    parameters = (Parameter("c", value=0.7), Parameter("k", 2, scale=(2.0, 3.0), free=True), Parameter("unused"))
    return Problem("all", (first, second, third), Objective("cost", cost, maximize=True), parameters, boundary)


def cost(e: Ends) -> ca.SX:
    integral = e.integral["first"]
    bilinear = ca.exp(e.integral["second"]["g"] * integral["h"])
    timed = e.duration["second"] ** 2 * e.p["k"][0] + e.final["first"].t * e.p["c"]
    return integral["e"] ** 2 * e.final["first"].q[0] + bilinear + timed


def integral_rows(e: Ends) -> ca.SX:
    mixed = e.integral["second"]["g"] * e.initial["first"].q * e.p["k"]
    return ca.vertcat(mixed, e.integral["first"]["e"] ** 2)


def differentiated(nlp: dict[str, ca.MX]) -> ca.Function:
    """f, gradient, g, Jacobian and the Hessian's upper triangle by CasADi."""
    x, p, f, g = (nlp[k] for k in "xpfg")
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    hessian = ca.hessian(lam_f * f + ca.dot(lam_g, g), x)[0]
    return ca.Function("ad", [x, p, lam_f, lam_g], [f, ca.gradient(f, x), g, ca.jacobian(g, x), ca.triu(hessian)])


def by_hand(transcription: Transcription, z: np.ndarray, p: np.ndarray, lam: np.ndarray) -> list[ca.DM]:
    """The same from the assembled functions."""
    given = transcription.program.options
    hessian = given["hess_lag"](z, p, 1.3, lam)
    assert hessian.sparsity().is_triu()
    return [*given["grad_f"](z, p), *given["jac_g"](z, p), hessian]


SCHEMES = (radau(1), radau(2), radau(3), HERMITE_SIMPSON, TRAPEZOIDAL)


@pytest.mark.parametrize("method", SCHEMES, ids=lambda s: s.name)
@pytest.mark.parametrize("meshes", [(uniform(3), ARCS, uniform(2)), (ARCS, UNEVEN, ARCS), (UNEVEN, uniform(1), ARCS)])
def test_assembled_derivatives_are_exact(method: Scheme, meshes: tuple[PhaseMesh, ...]) -> None:
    problem = everything()
    t = Transcription(problem, method, {p.name: m for p, m in zip(problem.phases, meshes, strict=True)})
    reference, rng = differentiated(t.nlp), np.random.default_rng(1)
    for _ in range(2):
        z, lam = rng.uniform(0.3, 1.0, len(t.scale)), rng.normal(size=len(t.lbg))
        p = t.parameter_values({"c": rng.normal()})
        for mine, theirs in zip(by_hand(t, z, p, lam), reference(z, p, 1.3, lam), strict=True):
            expected = theirs.full()
            np.testing.assert_allclose(mine.full(), expected, rtol=1e-9, atol=1e-9 * max(1, np.abs(expected).max()))


@pytest.mark.parametrize("method", SCHEMES, ids=lambda s: s.name)
def test_defects_are_the_runge_kutta_equations(method: Scheme) -> None:
    """x_k - x_0 - h sum_j A_kj f(x_j, u_j, t_j), written out interval by interval."""
    problem = everything()
    t = Transcription(problem, method, {"first": ARCS, "second": uniform(2), "no-control": uniform(1)})
    z = np.random.default_rng(2).uniform(0.3, 1.0, len(t.scale))
    g = ca.Function("g", [t.nlp["x"], t.nlp["p"]], [t.nlp["g"]])(z, t.parameter_values())
    rows = t.rows[0]
    found = g.full().ravel()[rows.start : rows.stop].reshape(-1, 3) * rows.scale
    np.testing.assert_allclose(found, np.vstack(defects(t, t.layouts["first"], z)), atol=1e-12)


def defects(t: Transcription, layout: PhaseLayout, z: np.ndarray) -> list[np.ndarray]:
    """Defects (steps, nx) of every interval."""
    physical, where, steps = z * t.scale, t.variables["first"], t.scheme.steps
    X, U = physical[where.x].reshape(-1, 3), physical[where.u].reshape(-1, 3)
    durations, mesh, begin, result = physical[where.durations], layout.mesh, 0.0, []
    p = np.concatenate([[0.7], physical[t.parameters], [0.0]])
    for i in range(mesh.intervals):
        h = durations[mesh.arc[i]] * mesh.shares[i]
        controls = U[layout.controls_of[i]]  # every scheme here has a control at each abscissa
        x = X[i * steps : (i + 1) * steps + 1]
        points = zip(x[-len(t.scheme.c) :], controls, begin + h * np.array(t.scheme.c), strict=True)
        f = np.array([layout.stage.function(*point, p)[0].full().ravel() for point in points])
        result.append(x[1:] - x[0] - h * t.scheme.A @ f)
        begin += h
    return result


def test_a_fixed_parameter_without_integrals():
    """Nothing is integrated, and the Hessian still has its shape: minus sin x at the end, per p squared."""
    phase = Phase("one", (State("x"),), (Control("u"),), lambda s: {"x": s.u * s.p["p"]}, (1.0, 1.0))
    goal = Objective("goal", lambda e: ca.sin(e.final["one"].x * e.p["p"]))
    problem = Problem("plain", (phase,), goal, (Parameter("p", value=2.0),))
    t = Transcription(problem, radau(2), {"one": uniform(2)})
    z = np.linspace(0.1, 0.9, len(t.scale))
    H = t.program.hess_lag()(z, t.parameter_values(), 1.0, np.zeros(len(t.lbg)))
    exact, _ = ca.hessian(t.nlp["f"], t.nlp["x"])
    expected = ca.Function("h", [t.nlp["x"], t.nlp["p"]], [exact])(z, t.parameter_values())
    np.testing.assert_allclose(np.array(ca.DM(H)), np.triu(np.array(ca.DM(expected))), atol=1e-13)
    assert np.abs(np.array(ca.DM(H))).max() > 0.1
