"""Search for families of hops: at every value of an entry, then from each value to the next until no new optimum appears."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from hopopt.design import Design
from hopopt.errors import NotSolvedError
from hopopt.evidence.families import FamilyStudy
from hopopt.evidence.family_chains import Node
from hopopt.evidence.family_optima import Continuation, LocalOptimum, followed, refined, remember, searched
from hopopt.problem.checking.hints import hints
from hopopt.studies.faults import Fault, side_by_side
from hopopt.studies.sweep.definition import Definition

MOST_FOLLOWED = 8  # of the best optima at each value, that are followed
SMALLER = (0.25, 0.5, 0.75)  # of the way to a neighbouring value, if the whole step leads to another kind of hop
MAY_BE_BEST = 3e-3  # relative: by so much the first mesh may put two families in the wrong order

Say = Callable[[str], None]
Keep = Callable[[FamilyStudy], object]


def find_families(definition: Definition, processes: int, verify: bool, say: Say, keep: Keep) -> FamilyStudy:
    """Search at every value, follow every family, refine the best; ``keep`` is called whenever more is known.

    Raises NotSolvedError if no hop is found at any value.
    """
    designs = [definition.design_at(k) for k in range(len(definition.points))]
    study = FamilyStudy(definition, [[] for _ in designs])
    _search(study, designs, processes, say, keep)
    if not any(study.optima):
        reasons = [f"{where}: {fault.sentence}" for where, fault in study.faults.items()]
        raise NotSolvedError(
            f"{definition.design.name}: no hop was found at any value.", reasons or hints(definition.design)
        )
    _follow(study, designs, processes, say, keep)
    if verify:
        _refine(study, designs, processes, say, keep)
    return study


def _search(study: FamilyStudy, designs: Sequence[Design], processes: int, say: Say, keep: Keep) -> None:
    count = study.definition.starts or study.definition.design.solver.starts
    say(f"searching at {_values(len(designs))}")
    jobs = {k: (design, count) for k, design in enumerate(designs)}
    for done, (k, found) in enumerate(_each(study, "search", searched, jobs, processes), 1):
        study.optima[k] = found or []
        say(f"searched at {done} of {_values(len(designs))}: {sum(map(len, study.optima))} local optima")
        keep(study)


def _follow(study: FamilyStudy, designs: Sequence[Design], processes: int, say: Say, keep: Keep) -> None:
    """Follow every optimum to the values beside its own, then those that are new, until there is none."""
    new = {(k, i) for k, found in enumerate(study.optima) for i in range(min(len(found), MOST_FOLLOWED))}
    while new and len(designs) > 1:
        say(f"following {len(new)} local optima to the neighbouring values")
        sources = {k: sorted(n for n in new if abs(n[0] - k) == 1) for k in range(len(designs))}
        begun = {k: [_source(study, designs, n, k) for n in each] for k, each in sources.items() if each}
        jobs = {k: (designs[k], each, "neighbouring values") for k, each in begun.items()}
        new = set()
        for k, ends in _each(study, "following", followed, jobs, processes):
            for source, end in zip(sources[k], ends or (), strict=ends is not None):
                if end is not None:
                    new |= _linked(study, source, k, end)
            keep(study)


def _source(study: FamilyStudy, designs: Sequence[Design], node: Node, k: int) -> Continuation:
    """An optimum to be followed to value k, with the problems of smaller steps."""
    entry, begin, end = study.entry or "", study.values[node[0]], study.values[k]
    between = [study.definition.design_with({entry: begin + s * (end - begin)}) for s in SMALLER]
    return Continuation(designs[node[0]], study.optima[node[0]][node[1]], tuple(between))


def _linked(study: FamilyStudy, source: Node, k: int, end: LocalOptimum) -> set[Node]:
    """Note where an optimum leads; what is new and worth following."""
    place, new = remember(study.optima[k], end)
    study.steps.add((source, (k, place)))
    better = sum(o.clearance > end.clearance for o in study.optima[k])
    return {(k, place)} if new and better < MOST_FOLLOWED else set()


def _refine(study: FamilyStudy, designs: Sequence[Design], processes: int, say: Say, keep: Keep) -> None:
    say("refining and verifying the best at each value")
    jobs = {
        (k, i): (designs[k], o)
        for k, found in enumerate(study.optima)
        for i, o in enumerate(found)
        if o.clearance >= (1 - MAY_BE_BEST) * max(other.clearance for other in found)
    }
    for done, (node, result) in enumerate(_each(study, "refinement", refined, jobs, processes), 1):
        if result is not None:
            study.refined[node] = result
        say(f"refined and verified {done} of {len(jobs)}")
        keep(study)


def _values(count: int) -> str:
    return f"{count} value{'s' if count > 1 else ''}"


def _each(
    study: FamilyStudy, what: str, run: Callable[..., Any], jobs: dict[Any, tuple[Any, ...]], processes: int
) -> Iterator[tuple[Any, Any]]:
    """The result of every job with its key, as they end; None and a note in the study for one that a fault ended."""
    for key, result in side_by_side(run, jobs, processes):
        if isinstance(result, Fault):
            study.faults[f"{what} at value {(key[0] if isinstance(key, tuple) else key) + 1}"] = result
        yield key, None if isinstance(result, Fault) else result
