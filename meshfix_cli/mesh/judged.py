"""Some elements of a mesh, and the passes over all of them that tell which are valid and how good they are."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import JUDGED

Array = NDArray[np.float64]
VALID, INSIDE, CORNER = range(3)  # verdicts of `kernels.judge`


class Judged:
    """Some elements of a connectivity; positions, such as those of inverted ones, count among these.

    The quality of a simplex is its smallest (dihedral) angle, that of another element the angle whose sine is the
    smallest scaled Jacobian at its corners. Elements of a surface are judged one by one as plane ones, see `Unfolded`.
    """

    def __init__(
        self, mesh: kernels.Connectivity, rows: NDArray[np.integer] | None = None, normals: Array | None = None
    ) -> None:
        """Take the rows (k,) of elements; None: all of them. `normals` (m, 3): of a surface, from where it is seen."""
        self._mesh, self._rows, self._normals = mesh, rows, normals
        if not self.simplicial:
            self._codes, self._offsets, self._nodes = mesh.codes, mesh.node_offsets, mesh.nodes
            if rows is not None:
                self._codes = mesh.codes[rows]
                self._nodes = mesh.nodes[_spans(mesh.node_offsets, rows)]
                self._offsets = _offsets(np.array([one.nodes for one in JUDGED])[self._codes])
        self._unfolded: Unfolded | None = None
        if normals is not None:
            here = normals if rows is None else normals[rows]
            if self.simplicial:
                self._unfolded = Unfolded(self.simplices.ravel(), _offsets(np.full(len(here), 3)), here)
            else:
                self._unfolded = Unfolded(self._nodes, self._offsets, here, self._codes)

    @cached_property
    def simplices(self) -> NDArray[np.int32]:
        """(s, d+1) int32: their corner simplices."""
        mesh, rows = self._mesh, self._rows
        if rows is None:
            return mesh.simplices
        return mesh.simplices[rows if self.simplicial else _spans(mesh.simplex_offsets, rows)]

    def __len__(self) -> int:
        if self._rows is not None:
            return len(self._rows)
        return len(self._mesh.rows)

    @property
    def simplicial(self) -> bool:
        """Whether all elements of the mesh are simplices of one type."""
        return self._mesh.simplicial

    @property
    def rows(self) -> NDArray[np.integer]:
        """Their rows (k,)."""
        return np.arange(len(self), dtype=np.int32) if self._rows is None else self._rows

    def without(self, positions: NDArray[np.integer]) -> Judged:
        """Return the others."""
        return Judged(self._mesh, np.delete(self.rows, positions), self._normals) if len(positions) else self

    def vertices(self, which: NDArray[np.integer] | NDArray[np.bool_]) -> NDArray[np.int32]:
        """Return the vertices (any shape) of some elements, by their positions or a mask (k,)."""
        if self.simplicial:
            return self.simplices[which]
        return self._nodes[_spans(self._offsets, np.arange(len(self))[which])]

    def check(self, points: Array, threads: int) -> tuple[NDArray[np.int32], float]:
        """Return the positions of inverted elements, and the smallest signed measure of a corner simplex."""
        if self.simplicial and self._unfolded is not None:
            return self._unfolded.check(points, threads)
        inverted, smallest = kernels.check(*self._placed(points, threads), threads)
        if not self.simplicial:
            inverted = np.flatnonzero(self.judge(points, threads)[0]).astype(np.int32)
        return inverted, smallest

    def apart(self, points: Array, threads: int) -> tuple[Array, kernels.Connectivity]:
        """Return where those of a surface are one by one in the plane, and the connectivity of the nodes there."""
        assert self._unfolded is not None
        return self._unfolded.points(points, threads), self._unfolded.connectivity

    def judge(self, points: Array, threads: int) -> tuple[NDArray[np.uint8], Array, Array]:
        """Return for each element VALID, or where it is not, INSIDE or CORNER; its signed measure; and its quality.

        Each (k,); measures are areas or volumes in model units, qualities angles in radians.
        """
        if self.simplicial:
            measures, valid = kernels.measure(*self._placed(points, threads), threads)
            return np.where(valid, VALID, CORNER).astype(np.uint8), measures, self.angles(points, threads)
        verdicts, measures, sines = self._judge(points, threads)
        return verdicts, measures, _arc_sines(sines)

    def angles(self, points: Array, threads: int) -> Array:
        """Return the quality (k,) of each element as an angle in radians."""
        if self.simplicial:
            return kernels.angles(*self._placed(points, threads), threads)[0]
        return _arc_sines(self._judge(points, threads)[2])

    def min_sine2(self, points: Array, threads: int) -> float:
        """Return the smallest sine^2 of the valid ones; 1: there are none."""
        if self.simplicial:
            return kernels.min_sine2(*self._placed(points, threads), threads)
        verdicts, _, quality = self._judge(points, threads)
        return min(1.0, float(quality[verdicts == VALID].min(initial=1.0)) ** 2)

    def below(self, points: Array, sine2: float, threads: int) -> NDArray[np.integer]:
        """Return the positions of those whose sine^2 is smaller, and of those that are not valid."""
        if self.simplicial:
            return kernels.below(*self._placed(points, threads), sine2, threads)
        verdicts, _, quality = self._judge(points, threads)
        return np.flatnonzero((verdicts != VALID) | (quality * np.abs(quality) < sine2))

    def _judge(self, points: Array, threads: int) -> tuple[NDArray[np.uint8], Array, Array]:
        if self._unfolded is not None:
            points, nodes = self._unfolded.points(points, threads), self._unfolded.numbers
            return kernels.judge(points, self._codes, self._offsets, nodes, threads)
        return kernels.judge(points, self._codes, self._offsets, self._nodes, threads)

    def _placed(self, points: Array, threads: int) -> tuple[Array, NDArray[np.int32]]:
        """Return points and corner simplices as the kernels take them."""
        if self._unfolded is None:
            return points, self.simplices
        return self._unfolded.points(points, threads), self._unfolded.simplices


class Unfolded:
    """Elements of a surface, each by itself in a plane: that of its own area, seen from the side of its normal.

    So what is known of plane elements holds for them; one that is turned over has a negative area.
    """

    def __init__(
        self,
        nodes: NDArray[np.int32],
        offsets: NDArray[np.int32],
        normals: Array,
        codes: NDArray[np.uint8] | None = None,
    ) -> None:
        """Take elements, one behind the other, and the normals (m, 3) of the side from which each is seen.

        `codes`: of their types, see `elements.JUDGED`; None: they are triangles.
        """
        self._nodes, self._offsets, self._codes = np.ascontiguousarray(nodes), offsets, codes
        self._normals = np.ascontiguousarray(normals)
        self.numbers = np.arange(len(nodes), dtype=np.int32)
        self._last: tuple[Array, Array] | None = None

    @cached_property
    def connectivity(self) -> kernels.Connectivity:
        """That of the same elements where each has nodes of its own."""
        if self._codes is None:
            return kernels.Connectivity.part(self.numbers.reshape(-1, 3), len(self.numbers), 1)
        return kernels.Connectivity.part(self._codes, self.numbers, len(self.numbers), 2, 1)

    @cached_property
    def simplices(self) -> NDArray[np.int32]:
        """(s, 3) int32: their corner simplices, in these nodes."""
        return self.numbers.reshape(-1, 3) if self._codes is None else self.connectivity.simplices

    def check(self, points: Array, threads: int) -> tuple[NDArray[np.int32], float]:
        """Return what `Judged.check` does, where they are triangles."""
        return kernels.check_unfolded(points, self._offsets, self._nodes, self._normals, threads)

    def points(self, points: Array, threads: int) -> Array:
        """Return where these nodes (sum of nodes, 2) are in the plane, from points (k, 3)."""
        if self._last is None or self._last[0] is not points:
            self._last = points, kernels.unfold(points, self._offsets, self._nodes, self._normals, threads)
        return self._last[1]


def _arc_sines(sines: Array) -> Array:
    return kernels.arcsin(np.clip(sines, 0.0, 1.0))


def _offsets(counts: NDArray[np.integer]) -> NDArray[np.int32]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)


def _spans(offsets: NDArray[np.int32], rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the numbers from offsets[r] to offsets[r + 1] for each of some rows, one behind the other."""
    counts = offsets[rows + 1] - offsets[rows]
    starts = np.cumsum(counts) - counts
    return np.repeat(offsets[rows] - starts, counts) + np.arange(counts.sum())
