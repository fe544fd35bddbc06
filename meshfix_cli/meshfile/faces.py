"""Cells that a file gives by their faces: elements get the order of their nodes, and the others stay polyhedra.

Source: OpenFOAM User Guide, "Mesh description"; the loop of a face is positive seen from outside of the cell that owns
it, so that of the other cell is the same backwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError

Int64 = NDArray[np.int64]

_SLAB = 1 << 17  # cells at once
# Elements by their triangles and quadrilaterals; the base, of so many nodes, has one node over it or as many.
_KINDS = {"tetra": (4, 0, 3), "pyramid": (4, 1, 4), "wedge": (2, 3, 3), "hexahedron": (0, 6, 4)}
_CONES = ("tetra", "pyramid")


class _Sides(NamedTuple):
    """Sides of faces, sorted by the cells (k,) on them.

    Attributes
    ----------
    face, size : (k,) int64
        Which face it is, and how many vertices it has.
    inner : (k,) bool
        The cell is not the owner, and sees the face backwards.
    starts : (m+1,) int64
        Where the sides of each cell begin.
    """

    cell: Int64
    face: Int64
    inner: NDArray[np.bool_]
    size: Int64
    starts: Int64


class Faces(NamedTuple):
    """The faces of a mesh.

    Attributes
    ----------
    offsets : (f+1,) int64
        Face i has the vertices `vertices[offsets[i]:offsets[i + 1]]`.
    vertices : (k,) int
    owner, neighbour : (f,) int64
        The cells on both sides; -1: there is none.
    """

    offsets: Int64
    vertices: NDArray[np.integer[Any]]
    owner: Int64
    neighbour: Int64

    def loops(self, faces: Int64) -> Int64:
        """Return the vertices (..., 4) of triangles, whose last stands twice, and of quadrilaterals."""
        first = self.offsets[faces]
        last = self.offsets[faces + 1] - first - 1
        return self.vertices[first[..., None] + np.minimum(np.arange(4), last[..., None])].astype(np.int64)

    def cells(self) -> Iterator[tuple[str, Any, Int64]]:
        """Give the types of cells, the vertices (m, k) of all of a type, and the numbers (m,) of these cells.

        Of polyhedra the vertices are a list of arrays.

        Raises
        ------
        ReadError
            A face names a cell that cannot be.
        """
        sides = self._sides()
        starts, count = sides.starts, len(sides.starts) - 1
        numbers = [np.bincount(sides.cell[mask], minlength=count) for mask in (sides.size == 3, sides.size == 4)]
        known = np.zeros(count, dtype=bool)
        for kind, (triangles, quads, base) in _KINDS.items():
            alike = (numbers[0] == triangles) & (numbers[1] == quads) & (np.diff(starts) == triangles + quads)
            rows = np.flatnonzero(alike)
            slabs = [rows[at : at + _SLAB] for at in range(0, len(rows), _SLAB)]
            found = [self._elements(sides, starts[slab], triangles + quads, base, kind in _CONES) for slab in slabs]
            vertices = np.concatenate(found) if found else np.empty((0, 1), dtype=np.int64)
            whole = (vertices >= 0).all(axis=1)
            known[rows[whole]] = True
            if whole.any():
                yield kind, vertices[whole], rows[whole]
        if not known.all():
            rows = np.flatnonzero(~known)
            yield "polyhedron", self._polyhedra(sides, rows), rows

    def _sides(self) -> _Sides:
        """Sort both sides of all faces by their cells."""
        cell = np.concatenate([self.owner, self.neighbour])
        order = np.argsort(cell, kind="stable")[np.count_nonzero(cell < 0) :]
        cell, face = cell[order], order % len(self.owner)
        count = int(cell[-1]) + 1 if len(cell) else 0
        if count > len(cell):
            raise ReadError(f"is not a readable mesh: its faces name the cell {count - 1}, and there are not as many")
        size = np.diff(self.offsets)[face]
        return _Sides(cell, face, order >= len(self.owner), size, np.searchsorted(cell, np.arange(count + 1)))

    def _elements(self, sides: _Sides, starts: Int64, count: int, base: int, cone: bool) -> Int64:
        """Return the nodes (m, k) of elements of `count` faces, the first of which have these numbers (m,)."""
        at = starts[:, None] + np.arange(count)
        first = np.argmax(sides.size[at] == base, axis=1)
        at[np.arange(len(at)), first] = at[:, 0]
        at[:, 0] = starts + first
        loops = self.loops(sides.face[at])
        return _in_order(np.where(sides.inner[at][..., None], loops[..., ::-1], loops), base, cone)

    def _polyhedra(self, sides: _Sides, rows: Int64) -> list[Int64]:
        """Return the vertices of each of some cells."""
        mine = np.concatenate([np.arange(*sides.starts[row : row + 2]) for row in rows.tolist()])
        first, sizes = self.offsets[sides.face[mine]], sides.size[mine]
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        vertices = self.vertices[np.repeat(first, sizes) + within]
        pairs = np.unique(np.column_stack([np.repeat(sides.cell[mine], sizes), vertices]), axis=0)
        return np.split(pairs[:, 1], np.searchsorted(pairs[:, 0], rows[1:]))


def _in_order(loops: Int64, base: int, cone: bool) -> Int64:
    """Order the nodes (m, k) of elements by their faces (m, f, 4) seen from outside, the base first; -1: it is none."""
    bottom = loops[:, 0, [0, *range(base - 1, 0, -1)]] if base == 4 else _triangle(loops[:, 0])
    sides = loops[:, 1:].reshape(len(loops), -1)
    ahead = np.roll(loops[:, 1:], -1, axis=2).reshape(sides.shape)
    outside = (ahead[..., None] != bottom[:, None]).all(axis=2)
    if cone:
        apex = np.where(outside, ahead, -1).max(axis=1, initial=-1)
        nodes = np.column_stack([bottom, apex])
    else:
        tops = []
        for node in bottom.T:
            up = outside & (sides == node[:, None])
            tops.append(np.where(up.sum(axis=1) == 1, np.where(up, ahead, 0).sum(axis=1), -1))
        nodes = np.column_stack([bottom, *tops])
    ordered = np.sort(nodes, axis=1)
    whole = (ordered[:, 1:] != ordered[:, :-1]).all(axis=1)
    whole &= (ahead[..., None] == nodes[:, None]).any(axis=2).all(axis=1)
    return np.where(whole[:, None], nodes, -1)


def _triangle(loop: Int64) -> Int64:
    """Return the three vertices (m, 3), backwards, of loops (m, 4) in which one stands twice."""
    last = np.where(loop[:, 2] == loop[:, 3], loop[:, 2], loop[:, 3])
    middle = np.where(loop[:, 0] == loop[:, 1], loop[:, 2], loop[:, 1])
    return np.column_stack([loop[:, 0], last, middle])
