"""Results as a notebook shows them and as xarray and pandas hold them, with names of joints and units."""

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from hopopt.comparison.compare import OPTIMUM, Comparison
from hopopt.comparison.hops.hop_after_hop import HopsComparison
from hopopt.comparison.robust.robust import RobustHop
from hopopt.design.geometry.link_joint import Units
from hopopt.leg.kinematics import contact_axes
from hopopt.leg.robot import BASE
from hopopt.planner.solution import Solution
from hopopt.studies.choose.choice import Choice
from hopopt.studies.pareto.front import Front
from hopopt.studies.sweep.point_file import NOT_VERIFIED, VERIFIED
from hopopt.studies.sweep.run import Study
from hopopt.studies.sweep.store import alias_of

if TYPE_CHECKING:
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]
    import xarray as xr

INSTANTS = 201  # of a hop, if no times are given
NOTEBOOK_ROWS = 12  # of a table in a notebook
# Of a variable of joints: field of Units, and how it is called of a joint that slides.
OF_JOINTS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "angle": ("q", {"travel": "travel"}),
    "speed": ("v", {}),
    "angular_acceleration": ("a", {"travel": "acceleration"}),
    "torque": ("tau", {"travel": "force"}),
}


def solution_dataset(solution: Solution, t: ArrayLike | None = None) -> "xr.Dataset":
    """The hop at times t [s] since stance began (default: 201 equal steps): body x, z [m], v and a of it; of each joint
    angle [rad], speed, acceleration, torque [N m]; the contact force [N]; heights and places of all points [m].

    Raises UsageError for times outside the hop.
    """
    import xarray as xr  # takes a while

    s = solution.sample(np.linspace(0.0, solution.end, INSTANTS) if t is None else t)
    parts: dict[str, Any] = {"phase": ("t", s.phase)}
    units = [solution.design.leg.units(joint) for joint in solution.design.leg.joints]
    of_joints = {
        name: ", ".join(dict.fromkeys(getattr(unit, of) for unit in units)) for name, (of, _) in OF_JOINTS.items()
    }
    names = (("position", "angle", ""), ("velocity", "speed", "/s"), ("acceleration", "angular_acceleration", "/s^2"))
    for (of_body, of_joint, per), values in zip(names, (s.q, s.v, s.a), strict=True):
        parts[of_body] = (("t", "axis"), values[:, :BASE], {"units": f"m{per}"})
        parts[of_joint] = (("t", "joint"), values[:, BASE:], {"units": of_joints[of_joint]})
    parts["torque"] = (("t", "joint"), s.tau, {"units": of_joints["torque"]})
    parts["force"] = (("t", "direction"), s.f, {"units": "N"})
    parts["point"] = (("t", "name", "axis"), np.stack(list(s.points.values()), axis=1), {"units": "m"})
    labels = {
        "t": ("t", s.t, {"units": "s"}),
        "axis": ["x", "z"],
        "joint": list(solution.robot.joints),
        "direction": ["xyz"[k] for k in contact_axes(solution.design.leg)],
        "name": list(s.points),
    }
    about = {"problem": solution.design.name, "objective": solution.objective, "verified": int(solution.verified)}
    return xr.Dataset(parts, labels, about)


def solution_frame(solution: Solution, t: ArrayLike | None = None) -> "pd.DataFrame":
    """The same as a table: a row for every time, columns such as "knee torque [N m]"."""
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]

    data, columns = solution_dataset(solution, t), dict[str, Any]()
    units = [solution.design.leg.units(joint) for joint in solution.design.leg.joints]
    for name, values in data.data_vars.items():
        unit = f" [{values.attrs['units']}]" if "units" in values.attrs else ""
        if values.ndim == 1:
            columns[str(name)] = values.values
        for labels in np.ndindex(*values.shape[1:]) if values.ndim > 1 else ():
            own = units[int(labels[0])] if name in OF_JOINTS else None
            said, per_unit = (str(name), unit) if own is None else _called(own, str(name))
            words = [str(data[dim].values[k]) for dim, k in zip(values.dims[1:], labels, strict=True)]
            kind = {
                "position": ["body", *words],
                "velocity": ["body", *words, name],
                "acceleration": ["body", *words, name],
            }
            of = {"point": words, "force": ["force", *words]}
            columns[f"{' '.join(map(str, {**kind, **of}.get(str(name), [*words, said])))}{per_unit}"] = values.values[
                :, *labels
            ]
    return pd.DataFrame(columns, index=pd.Index(data["t"].values, name="t [s]"))


def _called(of: Units, name: str) -> tuple[str, str]:
    """How a variable is called of one joint, and its unit in brackets."""
    field, names = OF_JOINTS[name]
    return names.get(of.place, name), f" [{getattr(of, field)}]"


def comparison_frame(comparison: Comparison | HopsComparison) -> "pd.DataFrame":
    """A row for every strategy, an optimum from rest first, with the figures that are numbers; the unit ends a column's name."""
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]

    rows = comparison.as_dict()["strategies"]
    return pd.DataFrame([_numbers(row) for row in rows.values()], index=pd.Index(list(rows), name="strategy"))


def _numbers(row: Mapping[str, Any], path: str = "") -> dict[str, float]:
    """The numbers of nested tables by their path, joined by dots."""
    found: dict[str, float] = {}
    for key, value in row.items():
        if isinstance(value, Mapping):
            found |= _numbers(cast(Mapping[str, Any], value), f"{path}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found[f"{path}{key}"] = float(value)
    return found


def comparison_dataset(comparison: Comparison | HopsComparison) -> "xr.Dataset":
    """The same as a dataset along the strategies; what has dots in its name has another one without them."""
    return with_aliases(comparison_frame(comparison).to_xarray())


def with_aliases(data: "xr.Dataset") -> "xr.Dataset":
    """A dataset whose variables with dots in their names are there under names without dots too: peaks_ground_force_N."""
    return data.assign({alias: data[n] for n in data.data_vars if (alias := alias_of(str(n))) != n})


def study_dataset(study: Study) -> "xr.Dataset":
    """The points with a dimension for each varied entry if they are a grid; ``sel`` takes leg_gear_ratio for leg.gear.ratio."""
    data, entries = study.dataset, [axis.entry for axis in study.definition.axes]
    aliases = [alias_of(entry) for entry in entries if alias_of(entry) != entry and study.definition.shape]
    for alias in aliases:
        data = data.set_xindex(alias)
    return data


def study_frame(study: Study) -> "pd.DataFrame":
    """A row for every point: the varied entries, then what came of it."""
    data, entries = study.dataset, [axis.entry for axis in study.definition.axes]
    aliases = [alias for entry in entries if (alias := alias_of(entry)) != entry]
    return data.drop_vars(aliases).to_dataframe().reset_index()


def front_frame(front: Front) -> "pd.DataFrame":
    """A row for every point in the order of the clearances asked for; columns are named as those of a study."""
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]

    rows = [
        {
            "asked_m": p.asked_m, "point": p.kind, "outcome": VERIFIED if p.verified else NOT_VERIFIED, "clearance_m": p.clearance_m,
            "objective_value": p.value, "least": p.least, "seconds": p.seconds, "sentence": p.sentence,
        }
        for p in front.points
    ]  # fmt: skip
    return pd.DataFrame(rows)


def front_dataset(front: Front) -> "xr.Dataset":
    """The same along the clearances asked for."""
    table: Any = front_frame(front)
    data = table.set_index("asked_m").to_xarray()
    units = {"asked_m": "m", "clearance_m": "m", "objective_value": front.against.unit, "seconds": "s"}
    for name, unit in units.items():
        data[name].attrs["units"] = unit
    return data.assign_attrs(problem=front.design.name, objective=front.against.name)


def robust_frame(found: RobustHop) -> "pd.DataFrame":
    """A row for every drawn leg and strategy; columns are named as those of a study."""
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]

    rows = [
        {"strategy": name, "leg": k, "outcome": outcome, "clearance_m": float(height)}
        for name, r in found.reached.items()
        for k, (height, outcome) in enumerate(zip(r.clearances, r.outcomes, strict=True))
    ]
    return pd.DataFrame(rows)


def robust_dataset(found: RobustHop) -> "xr.Dataset":
    """The same along strategies and legs."""
    table: Any = robust_frame(found)
    data = table.set_index(["strategy", "leg"]).to_xarray()
    data["clearance_m"].attrs["units"] = "m"
    return data


def solution_html(solution: Solution) -> str:
    """What a notebook shows of a solution."""
    s = solution.shown
    rows: dict[str, Any] = {s.objective_figure: f"{s.reached:.4f} {s.objective_unit}", "status": s.status}
    rows |= {"stance [s]": f"{solution.lift_off:.3f}", "flight [s]": f"{solution.duration - solution.lift_off:.3f}"}
    if s.gains:
        rows["limiting constraint"] = next(iter(s.gains))
    if s.result_dir:
        rows["folder"] = s.result_dir
    return html(f"{s.title or s.problem}, objective {s.objective}", rows)


def comparison_html(comparison: Comparison) -> str:
    """What a notebook shows of a comparison."""
    rows = {name: f"{f.clearance:.4f} m" for name, f in comparison.figures.items()}
    if not comparison.solution.verified:
        rows[OPTIMUM] = "not verified"
    return html(f"{comparison.solution.design.name}: clearance of every strategy", rows)


def study_html(study: Study) -> str:
    """What a notebook shows of a study: its points, the last left out where there are many."""
    rows: dict[str, Any] = {}
    for p in study.points[:NOTEBOOK_ROWS]:
        where = ", ".join(
            f"{e} = {x if isinstance(x, str) else f'{x:.12g}'}" for e, x in study.definition.stated(p.values).items()
        )
        rows[where] = f"{p.clearance_m:.4f} m" if p.clearance_m is not None else p.outcome
    if len(study.points) > NOTEBOOK_ROWS:
        rows[f"{len(study.points) - NOTEBOOK_ROWS} more"] = "to_dataframe() has them"
    return html(repr(study).strip("<>"), rows)


def choice_frame(choice: Choice) -> "pd.DataFrame":
    """A row for every pair, those that clear first."""
    import pandas as pd  # pyright: ignore[reportMissingTypeStubs]

    rows = [{k: v for k, v in row.items() if k != "pair"} for row in choice.as_dict()["candidates"]]
    return pd.DataFrame(rows, index=pd.Index([row.pop("name") for row in rows], name="name"))


def choice_html(choice: Choice) -> str:
    """What a notebook shows of a choice: the pairs that clear."""
    rows = {c.pair.name: f"{c.mass:.3g} kg, {c.clearance:.3f} m, {c.state}" for c in choice.clearing[:NOTEBOOK_ROWS]}
    more = len(choice.clearing) - NOTEBOOK_ROWS
    rows |= {f"{more} more": "to_dataframe() has them"} if more > 0 else {}
    return html(repr(choice).strip("<>"), rows)


def html(title: str, rows: Mapping[str, Any]) -> str:
    """A table of names and values."""
    body = "".join(f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>" for name, value in rows.items())
    return f"<table><caption>{escape(title)}</caption>{body}</table>"
