"""The page of what a stated share of uncertain legs reaches: the promise, the bounds and PD control beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopopt.report.chart import Chart, span
from hopopt.report.html import render
from hopopt.storage.runs import read_data

COLORS = ("#0072B2", "#D55E00", "#009E73")  # of who tracks and of PD strategies, in turn
PLAN_WAYS = {"reserve": "a reserve tuned on them", "program": "one program for several legs"}  # how a plan is found
GAIN_UNITS = {"k_p": "N m/rad", "k_d": "N m s/rad"}  # of its feedback
WIDTH, ROW = 640, 64  # pixels: of the figure, and of each kind of control in it


@dataclass(frozen=True)
class Legs:
    """The drawn legs of one kind of control in the figure.

    name: of the control
    color: of its legs
    middle: of its row [pixels]
    places: of the legs, x and y (k, 2) [pixels]
    promise: what the share reaches [pixels]
    """

    name: str
    color: str
    middle: float
    places: np.ndarray
    promise: float


def is_robust(folder: Path) -> bool:
    """Whether a folder is what ``hopopt robust`` wrote."""
    return (folder / "robust.json").is_file()


def robust_page(folder: Path) -> str:
    """The HTML file of what ``hopopt robust`` wrote; ResultError if it cannot be read."""
    design, data = read_data(folder, "robust")
    drawn = data.get("clearances_m", {})  # results of earlier versions have none
    chart = _chart(data, drawn) if drawn else None
    found = {"folder": str(folder), "version of hopopt": str(data.get("hopopt", "not stated"))}
    found |= {"seed": str(data.get("seed", "not stated")), "reserves tried": str(data["evaluations"])}
    found |= {"wall time": f"{data['wall_s']:.1f} s"}
    return render(
        "robust.html", design, of="robust hop", kind=_kind(design.name, data), answer=answer(data), provenance=found,
        data=data, share=f"{100 * data['share']:g} %", chart=chart,
        legs=_legs(chart, data, drawn) if chart else [],
        way=PLAN_WAYS[data["way"]], units=GAIN_UNITS, uncertain={k: v for k, v in design.uncertainty.model_dump().items() if v},
    )  # fmt: skip


def answer(data: Mapping[str, Any]) -> list[str]:
    """What the share reaches and how sure that is, beside the bound and the best PD control, in plain words."""
    if not data["plan_verified"]:
        return ["No answer is stated: the plan was not verified."]
    share, height = f"{100 * data['share']:g} %", data["clearance_m"]
    words = [
        f"{share} of all legs within the stated uncertainty lift their lowest point at least {height:.3f} m above the "
        f"ground, with confidence {100 * data['confidence']:g} %."
    ]
    fell = "none fell" if not data["fell"] else f"{data['fell']} fell"
    words.append(f"Of {data['draws']} simulated legs {fell}.")
    if data["bound_m"] is not None:
        words.append(
            f"That is {height / data['bound_m']:.0%} of the bound, which a leg known exactly reaches on this ground."
        )
    best = data.get("pd_best")  # results of earlier versions chose it on the legs that they speak of
    if best in data["pd"]:
        words.append(f"With the paper's PD control ({best}) the same share reaches {data['pd'][best]:.3f} m.")
    return words


def _kind(name: str, data: Mapping[str, Any]) -> str:
    states = (data["plan_verified"], data["bound_m"] is not None, data["ideal_bound_m"] is not None)
    return f"Robust hop of the problem {name}, plan and bounds {'verified' if all(states) else 'NOT all verified'}"


# ---- what is drawn ----------------------------------------------------------------------------------------------


def _chart(data: Mapping[str, Any], drawn: Mapping[str, Sequence[float]]) -> Chart:
    """Clearances along x, a row for each kind of control."""
    known = [data[key] for key in ("ideal_bound_m", "bound_m", "plan_m", "clearance_m") if data[key] is not None]
    x = span(np.array([*known, *data["pd"].values()]), *(np.array(row) for row in drawn.values()), margin=0.08)
    return Chart(x, (0.0, 1.0), WIDTH, 60 + ROW * len(drawn), "clearance [m]", "")


def _legs(chart: Chart, data: Mapping[str, Any], drawn: Mapping[str, Sequence[float]]) -> list[Legs]:
    """The legs of each kind of control, spread across its row, for many reach nearly the same."""
    promises, found = {data["tracker"]: data["clearance_m"], **data["pd"]}, []
    for k, (name, heights) in enumerate(drawn.items()):
        middle = chart.frame[2] + 24 + ROW * k
        spread = middle + 8 * np.sin(2.4 * np.arange(len(heights)))  # looks drawn, is the same in every page
        x = chart.x_zero + chart.x_scale * np.sort(heights)
        places = np.column_stack([x, spread])
        found.append(Legs(name, COLORS[k % len(COLORS)], middle, places, chart.x_zero + chart.x_scale * promises[name]))
    return found
