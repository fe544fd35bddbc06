"""Cells that a file gives by their faces: elements get the order of their nodes, and the others stay polyhedra.

Source: OpenFOAM User Guide, "Mesh description"; the loop of a face is positive seen from outside of the cell that owns
it, so that of the other cell is the same backwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError

Int64 = NDArray[np.int64]
Integers = NDArray[np.int32] | NDArray[np.int64]

_ELEMENTS = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron"}  # by their corners


class Faces(NamedTuple):
    """The faces of a mesh.

    Attributes
    ----------
    offsets : (f+1,) int32 or int64
        Face i has the vertices `vertices[offsets[i]:offsets[i + 1]]`.
    vertices : (k,) int
    owner, neighbour : (f,) int
        The cells on both sides; -1: there is none, as may be for the neighbour. All are of one type.
    """

    offsets: Integers
    vertices: Integers
    owner: Integers
    neighbour: Integers

    @property
    def cells(self) -> int:
        """How many there are; ReadError where faces name more than can be."""
        count = int(max(self.owner.max(initial=-1), self.neighbour.max(initial=-1))) + 1
        if count > 2 * len(self.owner):
            raise ReadError(f"is not a readable mesh: its faces name the cell {count - 1}, and there are not as many")
        return count

    def elements(self, threads: int = 1) -> Iterator[tuple[str, Any, Int64]]:
        """Give the types of cells, the vertices (m, k) of all of a type, and the numbers (m,) of these cells.

        Of polyhedra the vertices are a list of arrays.
        """
        starts, faces, corners, nodes = kernels.cells_of_faces(*self, self.cells, threads)
        for count, key in _ELEMENTS.items():
            if len(rows := np.flatnonzero(corners == count)):
                whole = nodes.shape == (len(rows), count)
                yield key, nodes if whole else nodes[rows, :count], rows
        if len(rows := np.flatnonzero(corners == 0)):
            loops = (faces[first:last] for first, last in zip(starts[rows], starts[rows + 1], strict=True))
            yield "polyhedron", [self._vertices_of(mine) for mine in loops], rows

    def _vertices_of(self, faces: Integers) -> Integers:
        """Return the vertices (k,) of some faces."""
        found = [self.vertices[slice(*self.offsets[face : face + 2])] for face in faces.tolist()]
        return np.unique(np.concatenate([self.vertices[:0], *found]))
