"""A pair of its own for each joint: from the best pair for all joints, what lighter ones each joint can do with, and these together.

The product of all pairs at all joints is too large (656 pairs at two joints are 430 000). The best pair for all joints bounds it
from above. Joint by joint, with that pair at the others, every lighter one is tried; those with which the leg still clears are
combined. No combination that is heavier than one known to clear is solved.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

from hopopt.design import Design
from hopopt.errors import UsageError
from hopopt.problem.catalogue import Entry, catalogue
from hopopt.studies.choose.choice import Candidate, Choice
from hopopt.studies.choose.pairs import Combination, Pair, pairs
from hopopt.studies.choose.run import choose, written

MOST = 100  # combinations that are solved: of more the heaviest, which are likeliest to clear


def choose_each(
    design: Design, clearance: float, *, joints: Sequence[str] | None = None, only: Sequence[str] | None = None,
    legs: int = 1, by: str = "mass", verify: int = 3, present_mass: float | None = None,
    progress: Callable[[str], None] | None = None, listed: Callable[[Choice], None] = lambda found: None,
    entries: Mapping[str, Entry] | None = None, resume: object = None, **settings: Any,
) -> Choice:  # fmt: skip
    """Combinations of a pair for each joint that clear; as ``choose``, whose settings they are. Where they are none, what
    ``choose`` finds. UsageError for fewer than two joints, and for ``resume``: it is several choices."""
    known, say, names = (
        catalogue() if entries is None else entries,
        progress or (lambda text: None),
        tuple(joints or design.leg.joints),
    )
    if len(names) < 2 or resume is not None:
        raise UsageError(
            "--each is for two joints or more" if resume is None else "--each cannot go on with --resume: begin again"
        )
    every = {"entries": known, "legs": legs, "by": by, "progress": progress, **settings}
    say("one pair for all joints")
    one = choose(design, clearance, joints=joints, only=only, present_mass=present_mass, verify=0, **every)
    best = next(iter(one.clearing), None) or _highest(one)
    if best is None or not isinstance(best.pair, Pair):
        return one
    tried, base = _worth(one, best, pairs(known, only)), written(one, best)
    own = dict[str, list[Pair]]()
    for joint in names:
        say(f"pairs for the {joint} alone")
        found = choose(base, clearance, joints=[joint], tried=tried, present_mass=best.pair.mass, verify=0, **every)
        own[joint] = [c.pair for c in found.clearing if isinstance(c.pair, Pair)]
    combined = _combined(own, best.pair, bool(one.clearing))
    if not combined:
        return one
    say(f"{len(combined)} combinations")
    return choose(
        design,
        clearance,
        joints=joints,
        tried=combined,
        present_mass=present_mass,
        verify=verify,
        listed=listed,
        **every,
    )


def _highest(found: Choice) -> Candidate | None:
    """Of those that do not clear the one that comes nearest to it."""
    return max((c for c in found.candidates if c.clearance is not None), key=lambda c: c.clearance or 0.0, default=None)


def _worth(one: Choice, best: Candidate, every: Sequence[Pair]) -> list[Pair]:
    """Pairs that a joint alone may be better off with than with the best for all."""
    bounded = one.by == "mass" and bool(one.clearing)
    return [p for p in every if p.mass is not None and (not bounded or p.mass <= (best.pair.mass or 0.0))]


def _combined(own: Mapping[str, Sequence[Pair]], best: Pair, best_clears: bool) -> list[Combination]:
    """Combinations of the joints' own pairs, the lightest first; none heavier than one that is known to clear."""
    at_all = {joint: best for joint in own}
    clear = [Combination.of({**at_all, joint: pair}) for joint, found in own.items() for pair in found]
    clear += [Combination.of(at_all)] if best_clears else []
    most = min((c.mass for c in clear if c.mass is not None), default=None)
    if most is None:
        return []
    every = (dict(zip(own, chosen, strict=True)) for chosen in product(*({*found, best} for found in own.values())))
    light = [c for c in map(Combination.of, every) if c.mass is not None and c.mass <= most]
    return sorted(light, key=lambda c: (c.mass or 0.0, c.name))[-MOST:]
