"""What a diagnosis of the program means for a hop: limits, conflicts and flat directions in words, with the entries of
the problem file behind them."""

from collections.abc import Hashable, Sequence

import numpy as np

from hopopt.design import Design
from hopopt.drivetrain.operating_region.limits import CAPS
from hopopt.leg.limit_id import Kind, LimitId, kind_of
from hopopt.ocp.phases import duration_entry
from hopopt.optimality.directions.flat_directions import Flat
from hopopt.optimality.directions.infeasibility import Conflict, ConflictPart
from hopopt.optimality.limits import Limit
from hopopt.problem.render import toml_value

MOST_OF_CONFLICT = 5  # limits of a conflict that are named, and parameters that would help
MATTERS = 0.05  # least share of a conflict that a parameter of twice its size would settle, to first order
CONTROLS = {
    "a": "torque of the {}",
    "loop_force": "force along {} in the closed loop",
    "drawn": "drawn power of the {}",
    "command": "command to the {}",
}
SAYS = {  # what a constraint says
    Kind.GROUND_FORCE: "the least vertical ground force",
    Kind.FRICTION: "the foot does not slip",
    Kind.DESCENT: "the body never descends",
    Kind.CLEARANCE: "the clearance asked for",
    Kind.WINDOW: "the foot within its window at the apex",
    Kind.LANDING_WINDOW: "the foot within its window at touchdown",
    Kind.COLLISION: "the leg clear of the body and of itself",
    Kind.OBSTACLE: "the leg clear of the obstacle",
    Kind.IMPACT_PUSH: "the ground pushes in the impact",
    Kind.IMPACT_FRICTION: "the foot does not slip in the impact",
}
INSENSITIVE, AS_GOOD = "insensitive: the objective does not depend on ", "; other motions are as good"


def words_of(design: Design, limit: Limit) -> tuple[str, str]:
    """What a limit says, and the entry that sets it with its value; the entry is empty if none does."""
    leg, of, inner = design.leg, limit.name.of, limit.name.label
    where = f" in {limit.phase}" if limit.phase else ""
    if limit.kind == "duration":
        return f"{'longest' if limit.upper else 'shortest'} {limit.phase}", _stated(design, duration_entry(limit.phase))
    if limit.kind in ("state", "final") and of == "q" and inner in leg.joints:
        side = "upper" if limit.upper else "lower"
        return f"{side} limit of the {inner}{where}", _stated(design, f"leg.{inner}.{side}")
    if not isinstance(of, LimitId):
        return f"{limit.name}{where}", ""
    return _said(of, inner, limit) + where, ", ".join(_stated(design, path) for path in of.keys(leg, inner))


def _said(of: LimitId, inner: Hashable, limit: Limit) -> str:
    """What a constraint of the leg says."""
    if of.kind is Kind.REGION:
        return f"the {of.joint}'s {inner if inner in CAPS else 'drive'}"
    if of.kind is Kind.HEIGHT:
        return f"the {inner} above the ground"
    return SAYS.get(of.kind, str(limit.name))


def _stated(design: Design, path: str) -> str:
    """An entry with its value, if it has one."""
    value = path_value(design, path)
    return path if value is None or value == () else f"{path} = {_shown(value)}"


def _shown(value: object) -> str:
    """A value as a file writes it, numbers shortened."""
    if isinstance(value, tuple):
        return f"[{', '.join(_shown(x) for x in value)}]"
    if isinstance(value, (bool, str)):
        return toml_value(value)
    return f"{value:g}"


def path_value(design: Design, path: str) -> object:
    """The value of the entry at a path such as leg.hip.upper."""
    found: object = design
    for key in path.split("."):
        tables = [getattr(found, name, {}) for name in ("joint", "link")]
        found = next((table[key] for table in tables if key in table), None) or getattr(found, key, None)
    return found


def conflict_words(design: Design, found: Conflict | None) -> list[str]:
    """A conflict in a few sentences: what cannot hold together, the loosest way out, and what would help most."""
    if found is None:
        return []
    if not found.parts:
        return [
            "All limits can hold together (a motion that meets them was found): try more starts, or more iterations."
        ]
    reported: dict[str, str] = {}
    for part in found.parts:
        reported.setdefault(*words_of(design, part.limit))
    named = [f"{words} ({entry})" if entry else words for words, entry in list(reported.items())[:MOST_OF_CONFLICT]]
    more = ", and what the leg's motion demands" if len(named) == 1 else ""
    sentences = [f"These cannot hold together: {'; '.join(named)}{more}."]
    ways: dict[str, str] = {}
    for part in sorted((p for p in found.parts if p.gives), key=lambda p: -p.gives):
        ways.setdefault(words_of(design, part.limit)[0], _way_out(part))
    sentences.append(f"Loosest way out: {'; '.join(words + way for words, way in ways.items())}.")
    if helps := [_help(*pair) for pair in list(found.helps.items())[:MOST_OF_CONFLICT] if abs(pair[1]) > MATTERS]:
        sentences.append(f"What would help most: {', '.join(helps)}.")
    return sentences


def _way_out(part: ConflictPart) -> str:
    limit = part.limit
    if kind_of(limit.name.of) is Kind.REGION:
        return f" {'higher' if limit.name.label in CAPS else 'stronger'} by {_percent(part.gives / abs(limit.bound))}{_when(part.when)}"
    return f", loosened by {part.gives:.3g} {limit.unit}".rstrip() + _when(part.when)


def _percent(share: float) -> str:
    return f"{share:.0%}" if share >= 0.095 else f"{100 * share:.2g}%"


def _when(when: tuple[float, float]) -> str:
    first, last = when
    if np.isnan(first):
        return ""
    return f" (at {first:.3f} s)" if f"{first:.3f}" == f"{last:.3f}" else f" (from {first:.3f} to {last:.3f} s)"


def _help(path: str, share: float) -> str:
    return f"{'more' if share > 0 else 'less'} {path}"


def flat_words(found: Sequence[Flat]) -> list[str]:
    """A sentence for what the objective does not depend on, by phase and time; none if it depends on everything."""
    together: dict[tuple[str, str], list[str]] = {}
    for f in found:
        when = f" from {f.when[0]:.3f} to {f.when[1]:.3f} s" if f.when else ""
        together.setdefault((f" in {f.phase}" if f.kind == "control" else "", when), []).append(_what(f))
    return [
        f"{INSENSITIVE}the {' and the '.join(names)}{phase}{when}{AS_GOOD}" for (phase, when), names in together.items()
    ]


def _what(f: Flat) -> str:
    if f.kind == "duration":
        return f"duration of {f.phase}"
    reported = CONTROLS.get(str(f.name.of), "") if f.name.label else ""
    return reported.format(f.name.label) or str(f.name)
