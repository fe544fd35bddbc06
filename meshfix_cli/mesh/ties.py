"""Nodes that lie between the corners of straight elements, on their edges, in their faces, inside, and follow these.

An element of second or higher order is the linear one of its corners where each of its other nodes lies where that has
it: then the two are one and the same map, and whatever is found out about the one holds for the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import Element
from meshfix_cli.mesh.topology import refers_outside

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.integer]
Blocks = Sequence[tuple[Element, Places]]

# By which share of the distance of its corners a node may lie off; of its element, where that is rounded to few digits.
STRAIGHT, STRAIGHT_OF_FEW_DIGITS = 1e-6, 1e-2
SAME = 1e-9  # by which weights may differ
SINGLE, DOUBLE = 2.0**-24, 2.0**-53  # rounding of numbers
ROUNDINGS = 3.0  # of the file that a node may lie off: its own, that of its corners, and that of whoever put it there
FEWEST_DIGITS, MOST_DIGITS = 6, 12  # of coordinates by which rounding is found out: of more than these it is none


@dataclass(frozen=True, eq=False)
class Tie:
    """Nodes that lie between the same number of corners each.

    Attributes
    ----------
    nodes : (t,) int
    corners : (t, w) int
        Ascending.
    weights : (t, w) float64
        Positive, with the sum 1.
    """

    nodes: Places
    corners: Places
    weights: Array

    def at(self, rows: Places | Mask) -> Tie:
        """Return some of them."""
        return Tie(self.nodes[rows], self.corners[rows], self.weights[rows])

    def middle(self, points: NDArray[np.floating]) -> Array:
        """Return where they lie (t, d) between corners at points (n, d)."""
        parts = (self.weights[:, k, None] * points[self.corners[:, k]] for k in range(self.corners.shape[1]))
        return sum(parts, np.zeros((len(self.nodes), points.shape[1])))


@dataclass(frozen=True, eq=False)
class Ties:
    """The nodes of elements of higher order that are no corners, each once.

    Attributes
    ----------
    n : int
        Number of points.
    groups : sequence of Tie
    """

    n: int
    groups: Sequence[Tie] = ()

    @cached_property
    def nodes(self) -> Mask:
        """(n,) bool: the nodes that follow corners."""
        mask = np.zeros(self.n, dtype=bool)
        for tie in self.groups:
            mask[tie.nodes] = True
        return mask

    def off(self, points: NDArray[np.floating], sizes: Callable[[], Array]) -> Mask:
        """Mark the nodes (n,) that do not lie between their corners, beyond rounding.

        Parameters
        ----------
        points : (n, d) float
        sizes : callable
            Gives for each node (n,) the size of the elements that it is of, the smallest; asked for in need.

        Raises
        ------
        InvalidMeshError
            A coordinate is not finite.
        """
        mask = np.zeros(self.n, dtype=bool)
        for tie in self.groups:
            wrong = ~np.isfinite(points[tie.nodes]).all(axis=1)
            if wrong.any():
                raise InvalidMeshError(f"vertex {tie.nodes[np.argmax(wrong)]} has a coordinate that is not finite")
            far = np.abs(points[tie.nodes] - tie.middle(points)).max(axis=1)
            doubtful = np.flatnonzero(~(far <= STRAIGHT * _extents(points[tie.corners])))
            if len(doubtful):
                some = tie.at(doubtful)
                there = np.concatenate([points[some.nodes, None], points[some.corners]], axis=1)
                bound = _allowance(there.astype(np.float64), sizes()[some.nodes])
                mask[some.nodes] = ~(far[doubtful] <= bound)
        return mask

    def follow(self, points: NDArray[np.floating], moved: Mask) -> Mask:
        """Put nodes of which a corner has moved, as marked (n,), between these at points (n, d); mark them (n,)."""
        followed = np.zeros(self.n, dtype=bool)
        for tie in self.groups:
            some = tie.at(np.flatnonzero(moved[tie.corners].any(axis=1)))
            points[some.nodes] = some.middle(points)
            followed[some.nodes] = True
        return followed

    def with_corners(self, mask: Mask) -> Mask:
        """Mark (n,) also the corners of marked nodes: where these stay, the others stay."""
        marked = mask.copy()
        for tie in self.groups:
            marked[tie.corners[mask[tie.nodes]]] = True
        return marked


def ties_of(blocks: Blocks, n: int) -> tuple[Ties, Mask]:
    """Find which node lies between which corners.

    Parameters
    ----------
    blocks : sequence of (Element, (k, nodes) int)
        Elements with all their nodes; those of linear types have no others than corners.
    n : int
        Number of points.

    Returns
    -------
    ties : Ties
    at_odds : (m,) bool
        The elements that have a node between other corners than an element before them.

    Raises
    ------
    InvalidMeshError
        A number of a node is out of range.
    """
    starts = np.cumsum([0, *(len(rows) for _, rows in blocks)]).tolist()
    for (_, rows), start in zip(blocks, starts, strict=False):
        outside = ((rows < 0) | (rows >= n)).any(axis=1)
        if outside.any():
            row = int(np.argmax(outside))
            raise refers_outside(f"element {start + row}", rows[row], n)
    known = _Known(n)
    for element, rows in blocks:
        for _, tie in _between(element, rows):
            known.add(tie)
    at_odds = np.zeros(starts[-1], dtype=bool)
    for (element, rows), start in zip(blocks, starts, strict=False):
        for here, tie in _between(element, rows):
            at_odds[start + here[known.differ(tie)]] = True
    return Ties(n, tuple(known.groups.values())), at_odds


def curved(blocks: Blocks, ties: Ties, points: NDArray[np.floating]) -> Mask:
    """Mark the elements (m,) that have a node elsewhere than between its corners; see `ties_of` and `Ties.off`."""
    corners = [rows[:, : element.shape.corners] for element, rows in blocks]
    others = [rows[:, element.shape.corners :] for element, rows in blocks]

    @cache
    def sizes() -> Array:
        smallest = np.full(len(points), np.inf)
        for rows, nodes in zip(corners, others, strict=True):
            extents = _extents(points[rows])
            for column in nodes.T:
                np.minimum.at(smallest, column, extents)
        return smallest

    off = ties.off(points, sizes)
    return np.concatenate([off[nodes].any(axis=1) for nodes in others])


class _Known:
    """The first tie of each node, by the number of corners that it has."""

    def __init__(self, n: int) -> None:
        self._found: dict[int, list[Tie]] = {}
        # Of each node: how many corners it is between, and where it stands among such nodes.
        self._width, self._number = np.zeros(n, dtype=np.int32), np.full(n, -1, dtype=np.int32)
        self._last = np.empty(n, dtype=np.int32)

    def add(self, tie: Tie) -> None:
        """Take nodes that are new."""
        count, width = tie.corners.shape
        self._last[tie.nodes] = np.arange(count)  # of several that name one node
        fresh = tie.at((self._width[tie.nodes] == 0) & (self._last[tie.nodes] == np.arange(count)))
        mine = self._found.setdefault(width, [])
        before = sum(len(one.nodes) for one in mine)
        self._width[fresh.nodes] = width
        self._number[fresh.nodes] = np.arange(before, before + len(fresh.nodes))
        mine.append(fresh)

    @cached_property
    def groups(self) -> dict[int, Tie]:
        """All of them."""
        return {width: _joined(ties) for width, ties in self._found.items()}

    def differ(self, tie: Tie) -> Mask:
        """Mark the nodes (t,) of a tie that lie between other corners."""
        width = tie.corners.shape[1]
        different = self._width[tie.nodes] != width
        rows = np.flatnonzero(~different)
        mine, other = tie.at(rows), self.groups[width].at(self._number[tie.nodes[rows]])
        alike = (mine.corners == other.corners) & (np.abs(mine.weights - other.weights) < SAME)
        different[rows] = ~alike.all(axis=1)
        return different


def _between(element: Element, rows: Places) -> Iterator[tuple[Places, Tie]]:
    """Give the nodes of elements that are no corners, place by place, and the elements (t,) of each.

    In elements that name a corner several times a node may lie between fewer corners, or be one itself.
    """
    for place, weights in enumerate(element.weights, element.shape.corners):
        chosen = np.flatnonzero(weights)
        corners, shares = rows[:, chosen], np.array(weights)[chosen]
        if (shares == shares[0]).all():  # whatever the order
            tie = Tie(rows[:, place], np.sort(corners, axis=1), np.broadcast_to(shares, corners.shape))
        else:
            order = np.argsort(corners, axis=1)
            tie = Tie(rows[:, place], np.take_along_axis(corners, order, axis=1), shares[order])
        repeated = (tie.corners[:, 1:] == tie.corners[:, :-1]).any(axis=1)
        if repeated.any():
            yield from _collapsed(np.flatnonzero(repeated), tie.at(repeated))
            yield np.flatnonzero(~repeated), tie.at(~repeated)
        else:
            yield np.arange(len(rows)), tie


def _collapsed(here: Places, tie: Tie) -> Iterator[tuple[Places, Tie]]:
    """Give what ties are in which a corner stands several times."""
    corners, weights = tie.corners, tie.weights.copy()
    for k in range(1, corners.shape[1]):
        same = corners[:, k] == corners[:, k - 1]
        weights[same, k] += weights[same, k - 1]
        weights[same, k - 1] = 0.0
    left = (weights > 0).sum(axis=1)
    order = np.argsort(weights == 0, axis=1, kind="stable")
    corners, weights = np.take_along_axis(corners, order, axis=1), np.take_along_axis(weights, order, axis=1)
    for count in np.unique(left).tolist():
        rows = (left == count) & ~((count == 1) & (corners[:, 0] == tie.nodes))
        yield here[rows], Tie(tie.nodes[rows], corners[rows, :count], weights[rows, :count])


def _joined(ties: Sequence[Tie]) -> Tie:
    nodes, corners, weights = (
        np.concatenate([getattr(tie, name) for tie in ties]) for name in ("nodes", "corners", "weights")
    )
    return Tie(nodes, corners, weights)


def _extents(positions: NDArray[np.floating]) -> Array:
    """Return the longest side (t,) of the box around positions (t, k, d)."""
    return np.asarray((positions.max(axis=1) - positions.min(axis=1)).max(axis=1), dtype=np.float64)


def _allowance(positions: Array, sizes: Array) -> Array:
    """Return how far off nodes may lie (t,) by the rounding of a file, together with their corners (t, k, d).

    How many digits a file has is told by those of all that stand together: it may be of several hands. `sizes` (t,) of
    elements limit what is believed.
    """
    count, width, d = positions.shape
    values = positions.reshape(count, width * d)
    scale = 10.0 ** -np.floor(np.log10(np.where(values == 0, 1.0, np.abs(values))))
    step = np.full(count, DOUBLE)
    for digits in range(MOST_DIGITS, FEWEST_DIGITS - 1, -1):
        shifted = values * scale * 10.0 ** (digits - 1)
        few = (np.abs(shifted - np.rint(shifted)) <= 1e-15 * 10.0**digits).all(axis=1)
        step[few] = 0.5 * 10.0 ** (1 - digits)
    with np.errstate(over="ignore"):
        single = (values.astype(np.float32) == values).all(axis=1)
    step[single] = np.maximum(step[single], SINGLE)
    most = ROUNDINGS * np.abs(values).max(axis=1)
    return np.maximum(np.minimum(most * step, STRAIGHT_OF_FEW_DIGITS * sizes), most * DOUBLE)
