"""Which local optima at neighbouring values of an entry belong to one family, by where each leads when it is followed."""

from collections.abc import Iterable, Sequence

Node = tuple[int, int]  # index of a value, and of an optimum there
Step = tuple[Node, Node]  # the first optimum, followed to the value of the second, ends in the second


def chains(counts: Sequence[int], steps: Iterable[Step]) -> list[list[Node]]:
    """Families as rows of optima at neighbouring values, each optimum in one of them.

    counts (values,): optima at each value; steps: where followed optima end. Two optima belong together if each leads to
    the other, or if one leads to the other and nothing speaks for a third.
    """
    after = dict[Node, Node]()
    every = set(steps)
    for k in range(len(counts) - 1):
        after |= _joined({(a, b) for a, b in every if a[0] == k and b[0] == k + 1},
                         {(b, a) for a, b in every if a[0] == k + 1 and b[0] == k})  # fmt: skip
    begun = [(k, i) for k, count in enumerate(counts) for i in range(count)]
    return [_row(node, after) for node in begun if node not in after.values()]


def _joined(up: set[Step], down: set[Step]) -> dict[Node, Node]:
    """Pairs of optima at two neighbouring values, the lower first; ``up`` and ``down``: who leads to whom, the lower first."""
    mutual = up & down
    taken = {node for pair in mutual for node in pair}
    left = {pair for pair in up | down if not taken & set(pair)}
    ends = [node for pair in left for node in pair]
    return dict(mutual) | {a: b for a, b in left if ends.count(a) == ends.count(b) == 1}


def _row(node: Node, after: dict[Node, Node]) -> list[Node]:
    row = [node]
    while row[-1] in after:
        row.append(after[row[-1]])
    return row


def letter(k: int) -> str:
    """A, B, ... Z, AA, AB, ... for 0, 1, ..."""
    return (letter(k // 26 - 1) if k >= 26 else "") + chr(ord("A") + k % 26)
