"""Curved elements: which nodes they have, and the passes over all of them that tell which are valid."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import ELEMENTS, Element, element_of
from meshfix_cli.mesh.ties import Ties, ties_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BENT = 1e-6  # of an element's size, by which its nodes may lie off and it is straight
MOST_NODES = 128  # that the kernels have room for: quadrilaterals of tenth order, hexahedra of fourth

# The types of second order that are judged by the Bezier coefficients of their nodes, in the order of the kernels'
# numbers for them. Those of higher order have numbers behind them, which each mesh gives anew.
SECOND_ORDER = tuple(
    ELEMENTS[key]
    for key in ("triangle6", "quad8", "quad9", "tetra10", "wedge15", "wedge18", "hexahedron20", "hexahedron27")
)


def is_judged(element: Element) -> bool:
    """Whether elements of a type are judged where they are curved."""
    kind = element.lattice
    if kind is None:
        return element in SECOND_ORDER
    return kind.complete and kind.family in _FAMILIES and element.nodes <= MOST_NODES


_FAMILIES = frozenset({"triangle", "quad", "tetra", "wedge", "hexahedron"})


@cache
def _type_of(element: Element) -> kernels.QuadraticType:
    """Return what the kernels know of a type of more than second order."""
    kind = element.lattice
    assert kind is not None
    return kernels.QuadraticType(kind.factors, kind.order, np.array(kind.barycentric), element.shape.weight)


class Judgement(NamedTuple):
    """What a pass over all elements tells of each; each (m,).

    Attributes
    ----------
    verdicts : uint8
        `judged.VALID`, INSIDE or CORNER; the last at a node.
    smallest : float64
        The smallest Bezier coefficient of the Jacobian determinant, relative to that of the straight element.
    measures : float64
        Signed areas or volumes in model units.
    scaled_jacobians : float64
        The smallest one at the nodes.
    """

    verdicts: NDArray[np.uint8]
    smallest: Array
    measures: Array
    scaled_jacobians: Array


def _known(key: str) -> Element:
    element = element_of(key)
    assert element is not None
    return element


class Quadratic:
    """Elements of second or higher order of a mesh, of which some are curved.

    Attributes
    ----------
    rows : (m,) int
        Which elements of the mesh they are.
    free : (n,) bool
        The nodes between corners that may move.
    giving : (n,) bool
        Those that are held for no other reason than that they are on the boundary.
    types : tuple of Element
        `SECOND_ORDER`, and others that there are.
    codes : (m,) uint8
        Their types, positions in these.
    offsets : (m+1,) int64
        Where the nodes of each begin in `nodes`.
    nodes : int32
        Points, in VTK's order, positively oriented.
    n : int
        Number of points.
    ties : Ties
        Between which corners nodes lie, of these elements and maybe of others.
    kernel : kernels.QuadraticMesh
    """

    def __init__(
        self,
        blocks: Sequence[tuple[str, NDArray[np.integer]]],
        n: int,
        rows: NDArray[np.integer] | None = None,
        ties: Ties | None = None,
    ) -> None:
        """Take elements by their types, such as ("tetra10", nodes (k, 10)); by default they are all of the mesh.

        `ties`, of these and maybe of others, are found where they are not given.
        """
        elements = [_known(key) for key, _ in blocks]
        others = dict.fromkeys(element for element in elements if element not in SECOND_ORDER)
        self.types = (*SECOND_ORDER, *others)
        code = {element.key: i for i, element in enumerate(self.types)}
        self.codes = np.concatenate([np.full(len(nodes), code[key], dtype=np.uint8) for key, nodes in blocks])
        self.nodes = np.concatenate([nodes.ravel() for _, nodes in blocks]).astype(np.int32)
        self.offsets = np.concatenate([[0], np.cumsum(np.array([one.nodes for one in self.types])[self.codes])])
        self.n = n
        self.rows = np.arange(len(self.codes)) if rows is None else rows
        self.ties = ties or ties_of(list(zip(elements, (nodes for _, nodes in blocks), strict=True)), n)[0]
        self.free = self.used & ~self.corners
        self.giving = np.zeros(n, dtype=bool)
        self._judged: tuple[Array, Judgement] | None = None
        self.kernel = kernels.QuadraticMesh(self.codes, self.nodes, n, [_type_of(element) for element in others])

    def holding(self, held: Mask, giving: Mask) -> Quadratic:
        """Return the same elements with nodes held, both (n,) bool; see `giving`."""
        other = copy(self)
        other.free = self.free & ~held
        other.giving = self.free & held & giving
        return other

    def __len__(self) -> int:
        return len(self.codes)

    def part(self, elements: Mask) -> Quadratic:
        """Return marked elements (m,) alone, those of one type behind the other; nodes stay as free as they are."""
        blocks, rows = [], []
        for code in np.unique(self.codes[elements]):
            some = np.flatnonzero(elements & (self.codes == code))
            count = self.types[code].nodes
            blocks.append((self.types[code].key, self.nodes[self.offsets[some][:, None] + np.arange(count)]))
            rows.append(self.rows[some])
        found = Quadratic(blocks, self.n, np.concatenate(rows), self.ties)
        found.free, found.giving = self.free, self.giving
        return found

    def judge(self, points: Array, threads: int) -> Judgement:
        """Look at all elements at positions (n, d) of all points; not once more at the last that were judged."""
        if self._judged is None or not np.array_equal(self._judged[0], points):
            self._judged = points.copy(), Judgement(*self.kernel.judge(points, threads))
        return self._judged[1]

    def judge_again(self, before: Judgement, nodes: Mask, points: Array, threads: int) -> Judgement:
        """Return what is judged before of positions that have changed at marked nodes (n,) alone."""
        elements = np.flatnonzero(self.with_one(nodes)).astype(np.int32)
        verdicts, smallest = before.verdicts.copy(), before.smallest.copy()
        measures, jacobians = before.measures.copy(), before.scaled_jacobians.copy()
        some = self.kernel.judge(points, threads, elements)
        verdicts[elements], smallest[elements], measures[elements], jacobians[elements] = some
        return Judgement(verdicts, smallest, measures, jacobians)

    @cached_property
    def corners(self) -> Mask:
        """(n,) bool: the points that are corners of elements."""
        return self.used & ~self.ties.nodes

    @cached_property
    def used(self) -> Mask:
        """(n,) bool: the points that are nodes of elements."""
        mask = np.zeros(self.n, dtype=bool)
        mask[self.nodes] = True
        return mask

    def straight(self, points: Array) -> Array:
        """Return points (n, d) with each node that is no corner where the straight element has it."""
        found = points.copy()
        for tie in self.ties.groups:
            found[tie.nodes] = tie.middle(points)
        return found

    def bent(self, points: Array) -> Mask:
        """Mark the elements (m,) that have a node off the place where the straight element has it, beyond rounding."""
        off = np.linalg.norm(points - self.straight(points), axis=1)
        off[~self.used] = 0.0
        first = np.add.reduceat(points[self.nodes], self.offsets[:-1]) / np.diff(self.offsets)[:, None]
        apart = points[self.nodes] - np.repeat(first, np.diff(self.offsets), axis=0)
        size = np.maximum.reduceat(np.linalg.norm(apart, axis=1), self.offsets[:-1])
        return np.asarray(np.maximum.reduceat(off[self.nodes], self.offsets[:-1]) > BENT * size)

    def follow(self, before: Array, after: Array) -> Array:
        """Return points (n, d) whose corners have moved, with other nodes moved by the mean of their corners' ways."""
        ways = self.straight(after - before)
        ways[~self.used | self.corners] = 0
        return after + ways

    def of(self, elements: Mask) -> Mask:
        """Mark the nodes (n,) of marked elements (m,)."""
        mask = np.zeros(self.n, dtype=bool)
        mask[self.nodes[np.repeat(elements, np.diff(self.offsets))]] = True
        return mask

    def with_one(self, nodes: Mask) -> Mask:
        """Mark the elements (m,) that have a marked node (n,)."""
        return np.logical_or.reduceat(nodes[self.nodes], self.offsets[:-1])

    def near(self, elements: Mask, rings: int) -> Mask:
        """Mark the nodes (n,) of marked elements (m,) and of rings of elements around them."""
        nodes = self.of(elements)
        for _ in range(rings):
            nodes = self.of(self.with_one(nodes))
        return nodes
