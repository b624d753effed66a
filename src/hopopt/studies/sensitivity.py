"""What to change first: the derivative of the best hop's objective by every number of its problem, from the multipliers.

The leg's masses, lengths and drives are parameters of the nonlinear program (optimality/directions/parametric_sensitivity.py); limits of joints,
durations and heights are its bounds. The start pose is both: its angles are given values, which follow from the
lengths and the hip's height by inverse kinematics, so they enter by the chain rule.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hopopt.design import Design, Leg, physical_parameters
from hopopt.design.drives.motor import LINEAR
from hopopt.design.parameters import variable_numbers
from hopopt.errors import UsageError
from hopopt.leg.geometry.solids import has_shape
from hopopt.leg.kinematics import foot_jacobian, joint_positions, start_angles
from hopopt.leg.limit_id import Kind, LimitId, kind_of
from hopopt.leg.scales import Scale
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.ocp.phases import STANCE, duration_entry
from hopopt.optimality.directions.kinks import DIFFERS, kink
from hopopt.optimality.directions.parametric_sensitivity import Slopes, gradient_by_parameters, magnitudes, slopes
from hopopt.optimality.directions.touchdown_slopes import touchdown_slopes
from hopopt.planner.answer.program_figures import by_friction
from hopopt.planner.solution import Solution, stored_nlp
from hopopt.problem.render import unit_at, value_at
from hopopt.studies.influence import Influence

FELT_HEIGHT = 1e-6  # [m] on the paper's leg, of another objective a share, that twice an entry's value must make of two sides that differ
STRAIGHT = 1e-6  # sine of the knee's angle below which a leg counts as stretched


def sensitivity(solution: Solution) -> list[Influence]:
    """Every entry that the objective depends on, the most rewarding per cent first (entries at 0 last, per unit).

    solution is what ``solve`` or ``read`` returned. Lengths of a leg with shapes are left out: what a radius or a
    distance between solids has of them is a number in the program. Raises UsageError where the start pose has no derivative.
    """
    design, unit = solution.design, solution.summary.objective_unit
    nlp = stored_nlp(with_own_drives(solution))
    maximize = nlp.transcription.problem.objective.maximize
    by_parameters = gradient_by_parameters(nlp.transcription)

    def all_of(s: NlpSolution) -> dict[str, tuple[float, str | None]]:
        return derivatives(design, slopes(s, by_parameters))

    found = all_of(nlp)
    sizes = derivatives(design, magnitudes(nlp), signed=False)
    more, less, between = _sides(nlp, lambda s: np.array([slope for slope, _ in all_of(s).values()]))
    influences = list[Influence]()
    hardly = FELT_HEIGHT * (Scale.of(design.leg).length if unit == "m" else abs(nlp.objective))
    for k, (name, (_, part_of)) in enumerate(found.items()):
        if name.endswith(".length") and has_shape(design.leg):
            continue
        value = value_at(design, part_of or name)
        felt = abs(more[k] - less[k]) * max(abs(value), 1.0)
        smooth = felt <= hardly or abs(more[k] - less[k]) <= DIFFERS * max(abs(more[k]), abs(less[k]))
        error = error_of(solution, sizes[name][0], float(value))
        i = Influence(
            name, float(value), unit_at(design, part_of or name), float(more[k]), part_of, error_per_unit=error, objective_unit=unit,
            maximize=maximize,
        )  # fmt: skip
        influences.append(i if smooth else replace(i, less_per_unit=float(less[k]), between=between))
    return sorted(influences, key=lambda i: (-i.most, -abs(i.per_unit)))


def _sides(
    nlp: NlpSolution, values: Callable[[NlpSolution], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Derivatives towards more and towards less of each entry, and the limits that trade places if they differ."""
    if (at := kink(nlp)) is None:
        return (here := values(nlp)), here, ()
    low, high = at.ranges(values)
    more, less = (low, high) if nlp.transcription.problem.objective.maximize else (high, low)
    return more, less, tuple(str(limit.name) for limit in at.limits())


def as_dict(solution: Solution, influences: Sequence[Influence], failed: Sequence[str]) -> dict[str, Any]:
    """For JSON: the optimum, every influence on it, and what its height is known to; nothing of the first two if
    it ``failed`` checks."""
    reached = {name: solution.summary.figure(name) for name in ("clearance_m", "apex_m")}
    height = {name: None if failed else value for name, value in reached.items() if value is not None}
    return {
        "problem": solution.design.name,
        "objective": solution.objective,
        **height,
        "verified": not failed,
        "exit_code": 3 if failed else 0,
        "failed_checks": list(failed),
        "optimum": str(solution.result_dir) if solution.result_dir else None,
        "objective_unit": solution.summary.objective_unit,
        "objective_value": None if failed else solution.summary.reached,
        "tie_break_bias": solution.summary.bias,
        "settled_within": settled_within(solution),
        "lengths_left_out": has_shape(solution.design.leg),
        "parameters": [i.as_dict() for i in influences],
    }


def settled_within(solution: Solution) -> float:
    """How far the optimum depends on the mesh [the objective's unit]: the last change with it, and the tightening cost."""
    names = ("change of the objective", "tightening cost")
    residuals = (solution.summary.check(name).residual for name in names)
    return sum(r for r in residuals if np.isfinite(r)) * abs(solution.summary.objective_value)


def error_of(solution: Solution, size: float, value: float) -> float | None:
    """Of a derivative whose parts come to ``size`` without their signs [objective's unit per unit], by an entry of this value;
    None for an entry that is 0, which has no size of its own.

    An optimum that is off by a share e of its objective is so by about sqrt(e) in its motion and multipliers, of which the
    objective knows the square alone. What it is off by may also go with the entry itself. Nobody looked closer than
    refinement's own tolerance.
    """
    objective = abs(solution.summary.objective_value) or 1.0
    share = max(settled_within(solution) / objective, solution.design.solver.objective_tolerance)
    return float(np.sqrt(share)) * size + share * objective / abs(value) if value else None


def with_own_drives(solution: Solution) -> Solution:
    """The same optimum of the same leg, the drive of every joint written out: each has parameters of its own."""
    leg, data = solution.design.leg, solution.design.model_dump(exclude_none=True)
    for _, joint, part, entry in drive_entries(leg):
        data["leg"][joint].setdefault(part, {})[entry] = leg.drive(joint, part, entry)[1]
    design = Design.model_validate(data)
    p = np.array(list(variable_numbers(design).values()))
    p = np.append(p, solution.kkt["p"][len(variable_numbers(solution.design)) :])  # what the objective adds
    return replace(solution, design=design, kkt={**solution.kkt, "p": p})


def drive_entries(leg: Leg) -> Iterator[tuple[str, str, Any, str]]:
    """Where each figure of each joint's drive stands: path, joint, part ("motor" or "gear"), entry, a linear motor's by its own name."""
    turning = {linear: entry for entry, linear in LINEAR.items()}
    for part in ("motor", "gear"):
        given = (p.split(".")[-1] for p in physical_parameters(leg) if f".{part}." in p)
        for entry in dict.fromkeys(turning.get(name, name) for name in given):
            for joint in leg.joints:
                path, value = leg.drive(joint, part, entry)
                if value is not None:
                    yield path, joint, part, path.rpartition(".")[2]


def derivatives(design: Design, by: Slopes, signed: bool = True) -> dict[str, tuple[float, str | None]]:
    """Path of each entry -> derivative [objective's unit per unit], and the entry it is one joint's part of, if it is.

    ``by`` belongs to the program of ``with_own_drives``; not ``signed``: what the parts of each come to without their signs.
    """
    own = by_entry(design, by, signed)
    users: dict[str, list[str]] = {}
    for path, joint, part, entry in drive_entries(design.leg):
        users.setdefault(path, []).append(f"leg.{joint}.{part}.{entry}")
    found: dict[str, tuple[float, str | None]] = {}
    for path, names in users.items():
        found[path] = (sum(own[name] for name in names), None)
        found |= {name: (own[name], path) for name in names if len(names) > 1}
    parts = {name for names in users.values() for name in names}
    return found | {path: (slope, None) for path, slope in own.items() if path not in parts | found.keys()}


def by_entry(design: Design, by: Slopes, signed: bool = True) -> dict[str, float]:
    """Path of each entry of a program's own problem -> derivative; not ``signed``: what its parts come to without their signs."""
    own = dict[str, float]()
    for path, slope in _contributions(design, by):
        own[path] = own.get(path, 0.0) + (slope if signed else abs(slope))
    return own


def _contributions(design: Design, by: Slopes) -> Iterator[tuple[str, float]]:
    """Paths and derivatives, to be summed by path."""
    yield from ((path, float(slope[0])) for path, slope in by.parameters.items())
    from_rest = not design.hop.periodic
    if from_rest:
        low, high = by.of_state(STANCE, "q")
        yield from ((path, float(part)) for path, dq in pose_slopes(design) for part in (low + high)[0] * dq)
    for phase in by.solution.phases:
        low, high = by.of_state(phase, "q")
        first = 1 if phase == STANCE and from_rest else 0  # it begins with given angles, which no limit moves
        for k, joint in enumerate(design.leg.joints):
            yield f"leg.{joint}.lower", float(low[first:, k].sum())
            yield f"leg.{joint}.upper", float(high[first:, k].sum())
        yield from zip((f"{duration_entry(phase)}[{k}]" for k in (0, 1)), by.of_duration(phase), strict=True)
    yield from _rows(design, by)
    if design.hop.lands:
        yield from touchdown_slopes(design, by)


def _rows(design: Design, by: Slopes) -> Iterator[tuple[str, float]]:
    """Entries that are limits of path and boundary constraints, or the factor of one: |f_x| <= mu f_z.

    Where a limit is enforced between the nodes, multipliers at the nodes have both signs (nlp/refinement/continuous_limits.py): both are of its side.
    """
    for r in by.solution.transcription.rows:
        low, high = by.of_rows(r)
        kind, key = kind_of(r.name), r.name.key if isinstance(r.name, LimitId) else ""
        if kind is Kind.GROUND_FORCE:
            yield key, float((low + high).sum())
        elif kind is Kind.FORCE_RATE:
            yield key, float((high - low).sum()) / float(design.contact.force_rate or 1.0)
        elif kind is Kind.FRICTION:
            yield key, -float(((low + high) * by_friction(by.solution, r.phase)).sum())
        elif kind is Kind.HEIGHT:
            yield key, float((low + high)[:, [row.label != "foot" for row in r.labels]].sum())
        elif kind is Kind.WINDOW:
            yield key, float(high.sum() - low.sum())


def pose_slopes(design: Design) -> Iterator[tuple[str, np.ndarray]]:
    """Entries that the joint angles of the start follow from, and d angles / d each, (n,) [rad per unit].

    From foot_offset(q, lengths) = (foot_x, -hip_height), differentiated; UsageError where the leg is stretched.
    """
    start, leg, q = design.start, design.leg, start_angles(design)
    if start.joint_angles is not None:
        yield from ((f"start.joint_angles[{k}]", column) for k, column in enumerate(np.eye(len(q))))
        return
    length = np.array([leg.link[name].length for name in leg.links])
    along = (np.diff(joint_positions(leg, q), axis=0) / length[:, None]).T[[0, 2]]  # d foot / d each length, (2, n)
    jacobian = foot_jacobian(leg, q)[[0, 2]]
    if abs(np.linalg.det(jacobian)) < STRAIGHT * length.prod():
        raise UsageError("start.hip_height: the leg starts stretched, where its pose has no derivative: start lower")
    inverse = np.linalg.inv(jacobian)
    yield from ((f"leg.{name}.length", -inverse @ along[:, k]) for k, name in enumerate(leg.links))
    yield from (("start.foot_x", inverse[:, 0]), ("start.hip_height", -inverse[:, 1]))
