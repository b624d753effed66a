"""The way of a map through its points: a tree from one point to all others, cut into pieces that are solved one by one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from hopopt.studies.sweep.definition import Definition
from hopopt.studies.sweep.first_program import formative_entries
from hopopt.studies.sweep.order import tree

MOST_POINTS = 24  # from which on a piece is cut off; they take a second or two
LEAST_POINTS = 3  # the same of small maps, which have this many pieces at least:
LEAST_PIECES = 12
OF_A_LIST = 4  # points of each piece of a list


@dataclass(frozen=True)
class Piece:
    """A connected part of the tree, which one process solves point after point.

    number: of the piece; the first is 0
    points: in an order in which every point comes after the one that it begins from
    begins: by point, the one that it begins from; of the first point that is in another piece, or it is the map's first
    exits: points from which other pieces begin
    """

    number: int
    points: tuple[int, ...]
    begins: Mapping[int, int]
    exits: frozenset[int]

    @property
    def entrance(self) -> int | None:
        """The point of another piece from which its first begins; None for the first piece."""
        return self.begins.get(self.points[0])


def pieces(definition: Definition, first: int) -> list[Piece]:
    """The whole tree from the first point, each piece after that from which it begins; of a list one piece after another."""
    if definition.listed:
        cuts = range(0, len(definition.points), OF_A_LIST)
        listed = [range(k, min(k + OF_A_LIST, len(definition.points))) for k in cuts]
        return [Piece(n, tuple(points), {}, frozenset()) for n, points in enumerate(listed)]
    order, parents = way(definition, first)
    size = min(MOST_POINTS, max(LEAST_POINTS, len(order) // LEAST_PIECES))
    heads = _cut(order, parents, size)
    number = {head: k for k, head in enumerate(k for k in order if k in heads)}
    piece_of, members = dict[int, int](), [list[int]() for _ in number]
    exits = [set[int]() for _ in number]
    for k in order:
        piece_of[k] = number[k] if k in heads else piece_of[parents[k]]
        members[piece_of[k]].append(k)
        if k in parents and piece_of[k] != piece_of[parents[k]]:
            exits[piece_of[parents[k]]].add(parents[k])
    return [
        Piece(n, tuple(found), {k: parents[k] for k in found if k in parents}, frozenset(exits[n]))
        for n, found in enumerate(members)
    ]


def _cut(order: Sequence[int], parents: Mapping[int, int], size: int) -> set[int]:
    """The first point of each piece: where so many points follow that no piece has begun with yet."""
    below, heads = dict.fromkeys(order, 1), {order[0]}
    for k in reversed(order):
        if k in parents and below[k] >= size:
            heads.add(k)
        elif k in parents:
            below[parents[k]] += below[k]
    return heads


def way(definition: Definition, first: int) -> tuple[list[int], dict[int, int]]:
    """An order of all points, and of all but the first the one that it begins from."""
    if definition.shape is None:
        return tree(definition.normalized, range(len(definition.points)), first)
    return _over_grid(definition, first)


def _over_grid(definition: Definition, first: int) -> tuple[list[int], dict[int, int]]:
    """From the first point along the axes: entries that have the program built anew change first, so that those of one
    program follow each other."""
    step = definition.spaced.astype(int)
    formative = formative_entries(definition)
    rank = sorted(range(step.shape[1]), key=lambda a: definition.axes[a].entry not in formative)
    by_place = {tuple(place): k for k, place in enumerate(step.tolist())}
    away = step - step[first]
    parents = dict[int, int]()
    for k in range(len(step)):
        moved = [a for a in rank if away[k, a]]
        if moved:
            place = step[k].copy()
            place[moved[-1]] -= np.sign(away[k, moved[-1]])
            parents[k] = by_place[tuple(place.tolist())]
    distance = np.abs(away).sum(axis=1)
    return sorted(range(len(step)), key=lambda k: (int(distance[k]), k)), parents


def neighbours(definition: Definition, chosen: Sequence[int]) -> dict[int, list[int]]:
    """By point of the study, the chosen points nearest to it, two for each axis at most, the nearest first."""
    x, every = definition.spaced, np.array(chosen, dtype=int)
    count = min(2 * x.shape[1] + 1, len(every))
    near = np.array(KDTree(x[every]).query(x, k=count)[1]).reshape(len(x), count)
    return {k: [g for g in every[row].tolist() if g != k][: 2 * x.shape[1]] for k, row in enumerate(near)}
