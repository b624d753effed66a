"""A result as one HTML file that needs no network: the answer in words, the hop moving, limits, evidence, parameters.

Numbers stand in ``data`` elements whose value is that of summary.json (or comparison.json) and whose key says which.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from markupsafe import Markup

from hopopt.design import Design
from hopopt.drivetrain.operating_region.region import operating_region
from hopopt.leg.robot import build_robot
from hopopt.planner.solution import Solution
from hopopt.record import as_data
from hopopt.report.chart import LEFT, RIGHT, Chart, span
from hopopt.report.html import part, render
from hopopt.report.motion import ShownHop

COLORS = ("#0072B2", "#D55E00", "#009E73", "#9A4C7D")  # told apart by colour-blind readers
DIGITS = 4  # of a number that is drawn: micrometres do not show
HEIGHT, WIDTH = 360, 520  # pixels of a chart


@dataclass(frozen=True)
class Content:
    """What a page shows.

    design: the problem
    hops: what moves on it, at most as many as there are colours, the first of them the answer
    solution: the answer, for limits and evidence; None where its files are elsewhere
    comparison: comparison.json, if the page is of a comparison
    provenance: name -> text of where the result comes from
    words: the answer in words, of what is neither solved nor compared
    """

    design: Design
    hops: Sequence[ShownHop]
    solution: Solution | None = None
    comparison: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, str] = field(default_factory=dict)
    words: Sequence[str] = ()


def page(content: Content) -> str:
    """The HTML file."""
    s, design = content.solution.shown if content.solution else None, content.design
    data = {**(as_data(s) if s else {}), **content.comparison}
    return render(
        "page.html", design, of="comparison" if content.comparison else "hop", kind=_kind(content),
        answer=answer(content), provenance=content.provenance, script=Markup(part("page.js")),
        hops=Markup(json.dumps([_plain(hop) for hop in content.hops]).replace("<", "\\u003c")),
        figure=lambda key: _looked_up(data, key), end=max(float(h.t[-1]) for h in content.hops),
        scenes=_scenes(content.hops), regions=_regions(design, content.hops), curves=_curves(content.hops),
        strategies=content.comparison.get("strategies", {}), summary=s, gains=dict(s.gains) if s else {},
        unit=s.objective_unit if s else "", passed=sum(c.passed and not c.left_out for c in s.verification) if s else 0,
        error_known=bool(s and isfinite(s.objective_error.too_high_by)),
    )  # fmt: skip


def answer(content: Content) -> list[str]:
    """The answer in plain words, a sentence or two each."""
    if content.comparison:
        return _compared(content.comparison)
    if content.solution is None:
        return list(content.words)
    s = content.solution.shown
    if not s.verified:
        return [f"No answer is stated: the hop was not verified. Failed checks: {', '.join(s.failed_checks)}."]
    words = [
        f"With these motors the leg can lift its {s.lowest_point} {_m(s.clearance_m)} above the ground in one hop."
    ]
    if s.objective != "clearance":
        reached = f"{s.reached:.4g} {s.objective_unit}".removesuffix(" 1")
        words = [f"This hop has the {'most' if s.maximized else 'least'} {s.objective.replace('_', ' ')}: {reached}."]
        if s.obstacle:
            words = [f"The whole leg clears a box {s.obstacle.width_m:g} m wide and {reached} high."]
        words[0] += f" It lifts the leg's lowest point {_m(s.clearance_m)} above the ground."
    if s.gains:
        words.append(f"What holds it back most: {next(iter(s.gains))}.")
    if s.paper_strategy and s.paper_strategy.clearance_m is not None:
        reached = s.paper_strategy.clearance_m
        words.append(
            f"The paper's PD control reaches {_m(reached)}, {reached / s.clearance_m:.0%} of that, in simulation."
        )
    return words


def _compared(data: Mapping[str, Any]) -> list[str]:
    if data["bound_m"] is None:
        return ["No bound is stated: the optimum was not verified."]
    words = [f"The optimum lifts the leg's lowest point {_m(data['bound_m'])} above the ground."]
    others = {name: row for name, row in data["strategies"].items() if name != "optimum"}
    kept = {name: row["clearance_m"] for name, row in others.items() if not row["limits_exceeded"]}
    if kept:
        best = max(kept, key=lambda name: kept[name])
        share = kept[best] / data["bound_m"]
        words.append(f"The best controller that keeps all limits, {best}, reaches {_m(kept[best])}, {share:.0%} of it.")
    if data["beaten_by"]:
        words.append(f"The bound is wrong: {', '.join(data['beaten_by'])} passes it.")
    return words


def _m(value: float) -> str:
    return f"{value:.3f} m"


def _kind(content: Content) -> str:
    if content.comparison:
        return f"Controllers compared on the problem {content.design.name}"
    if content.solution is None:
        return f"A robot's log, on the problem {content.design.name}"
    state = "verified" if content.solution.verified else "NOT verified"
    return f"Problem {content.design.name}, objective {content.solution.objective}, {state}"


def _looked_up(data: Mapping[str, Any], key: str) -> Any:
    """A figure by its dotted key; a name that has dots itself is taken whole."""
    value: Any = data
    while key:
        name = next(n for n in sorted(value, key=len, reverse=True) if key == n or key.startswith(f"{n}."))
        value, key = value[name], key[len(name) + 1 :]
    return value


def _plain(hop: ShownHop) -> dict[str, Any]:
    """What the script moves, rounded."""
    arrays = {name: getattr(hop, name).reshape(len(hop.t), -1) for name in ("chain", "bars")}
    arrays |= {"v": hop.v, "tau": hop.tau, "force": hop.force}
    return {"t": np.round(hop.t, DIGITS + 2).tolist()} | {k: np.round(a, DIGITS).tolist() for k, a in arrays.items()}


# ---- what is drawn ----------------------------------------------------------------------------------------------


def _scenes(hops: Sequence[ShownHop]) -> list[dict[str, Any]]:
    """The legs, all to one scale, width and height."""
    top = max(float(h.chain[..., 1].max()) for h in hops)
    y, scale, found = (-0.05 * top, 1.08 * top), (HEIGHT - 56) / (1.13 * top), []
    ways = [span(h.chain[..., 0], margin=0.08) for h in hops]
    width = max(WIDTH, *(round((high - low) * scale) + LEFT + RIGHT for low, high in ways))
    for hop, color, x in zip(hops, COLORS, ways, strict=False):
        room = 0.5 * ((width - LEFT - RIGHT) / scale - (x[1] - x[0]))
        chart = Chart((x[0] - room, x[1] + room), y, width, HEIGHT, "along [m]", "height [m]")
        pose, foot = chart.line(*hop.chain[0].T), chart.line(*hop.chain[:, -1].T)
        body = pose.partition(" ")[0].split(",")
        found.append({"hop": hop, "color": color, "chart": chart, "pose": pose, "foot": foot, "body": body})
        found[-1]["bars"] = [chart.line(*ends.T) for ends in hop.bars[0]]
        found[-1]["com"] = chart.line(*hop.com.T)
    return found


def _regions(design: Design, hops: Sequence[ShownHop]) -> list[dict[str, Any]]:
    """Each joint's operating region and the ways of all hops through it."""
    parameters, found = build_robot(design.leg).parameters, []
    for k, joint in enumerate(design.leg.joints):
        corners = operating_region(design.leg, joint, parameters).outline()
        x = span(corners[:, 0], *(h.v[:, k] for h in hops))
        y = span(corners[:, 1], *(h.tau[:, k] for h in hops))
        chart = Chart(x, y, WIDTH, HEIGHT, *design.leg.units(joint).labels[1:])
        paths = [_path(chart, h.v[:, k], h.tau[:, k], color) for h, color in zip(hops, COLORS, strict=False)]
        found.append({"joint": joint, "index": k, "chart": chart, "corners": chart.line(*corners.T), "paths": paths})
    return found


def _curves(hops: Sequence[ShownHop]) -> list[dict[str, Any]]:
    """Heights and ground force over time."""
    x, found = (0.0, max(float(h.t[-1]) for h in hops)), []
    series = {
        ("Height of the lowest point", "height [m]"): [h.lowest for h in hops],
        ("Height of the centre of mass", "height [m]"): [h.com[:, 1] for h in hops],
        ("Vertical ground force", "force [N]"): [h.force[:, 1] for h in hops],
    }
    for (title, label), values in series.items():
        chart = Chart(x, span(*values), WIDTH, HEIGHT, "time [s]", label)
        paths = [_path(chart, h.t, v, color) for h, v, color in zip(hops, values, COLORS, strict=False)]
        found.append({"title": title, "chart": chart, "paths": paths})
    return found


def _path(chart: Chart, x: np.ndarray, y: np.ndarray, color: str) -> dict[str, str]:
    return {"points": chart.line(x, y), "color": color}
