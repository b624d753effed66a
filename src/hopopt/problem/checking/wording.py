"""What an entry of a problem may be, and what its author may have meant, in words made from its schema."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any, TypeGuard

from hopopt.design.fields import LOOKALIKES
from hopopt.problem.checking.entries import Entry, bounds_of, unit_of, words_of
from hopopt.problem.render import shown

SHARE = (0.5, 10.0)  # least and largest upper bound of what may be a share; less is a tolerance, more a ratio
NEAR_WHOLE = 0.02  # relative: 0.33 is taken for 1/3
COUNTS = {2: "two numbers", 3: "three numbers", 6: "six numbers"}  # of a list that has so many
TYPE_NAMES = {
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
}  # JSON schema's -> in words


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The known word nearest to ``word`` as a question in brackets, empty if none is near."""
    close = get_close_matches(word, list(known), n=1)
    return f" (did you mean {close[0]}?)" if close else ""


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a file's value is a number; true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def allowed(entry: Entry) -> str:
    """What an entry may be."""
    low, high = bounds_of(entry)
    within = f" from {low:.10g} to {high:.10g} {unit_of(entry)}".rstrip() if low > -float("inf") else ""
    in_list = entry.get("type") == "array"
    if entry.get("allowed"):
        return entry["allowed"]
    if words := words_of(entry):
        return ("a list of " if in_list else "") + " or ".join(f'"{word}"' for word in words)
    if in_list and entry.get("items", {}).get("type") == "string":
        return 'a list of names, such as ["hip", "knee"],'
    if in_list:
        return f"a list of {COUNTS.get(len(entry.get('prefixItems', ())), 'numbers')}, each{within},"
    return TYPE_NAMES.get(entry.get("type", ""), "a table") + within


def hint(value: Any, entry: Entry, *, in_list: bool = False) -> str:
    """What the author of ``value`` (or of one ``in_list``) may have meant, to end a sentence; may be empty."""
    if not isinstance(value, str):
        return _of_number(value, entry) if is_number(value) else ""
    if entry.get("type") == "array" and not in_list:  # --set takes what is no TOML value as text
        return "; write its names in quotes" if value.startswith("[") else "; write it in [ ]"
    if close := get_close_matches(value, words_of(entry), n=1):
        return f'; did you mean "{close[0]}"?'
    return "; write the number alone, without quotes or unit" if entry.get("type") in ("integer", "number") else ""


def _of_number(value: float, entry: Entry) -> str:
    """Of a number that is out of range: another unit, the other sign, or else what the entry of a list has by default."""
    low, high = bounds_of(entry)
    if meant := lookalike(value, entry.get("unit", ""), (low, high)):
        return meant
    if value < 0 < low <= -value <= high:
        return f"; write {-value:.10g} if the sign is all that is wrong"
    default = entry.get("default")
    return f"; by default it is {shown(default)}" if entry.get("type") == "array" and default else ""


def lookalike(value: float, unit: str, bounds: tuple[float, float]) -> str:
    """What ``value`` means if it was written in another unit and is plausible then; empty if it does not."""
    low, high = bounds
    if not 1e-12 < abs(value) < 1e12 or low <= value <= high:
        return ""
    others = [(name, value * si) for name, si in LOOKALIKES.get(unit, ())]
    if unit == "1":
        others = _share_or_ratio(value, low, high)
    meant = [f"{name}: write {other:.6g}" for name, other in others if low <= other <= high]
    return f"; {shown(value)} looks like {', or like '.join(meant)}" if meant else ""


def _share_or_ratio(value: float, low: float, high: float) -> list[tuple[str, float]]:
    """A share that was written in per cent, or a ratio that the inverse of a whole number was written for."""
    if SHARE[0] <= high <= SHARE[1] and 2 <= value <= 100:
        return [("per cent", value / 100)]
    whole = round(1 / value)
    return [(f"1/{whole}", whole)] if low >= 1 and whole >= 2 and abs(whole * value - 1) < NEAR_WHOLE else []
