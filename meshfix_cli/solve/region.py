"""A part of a mesh by itself, as the methods take it that move all of its vertices at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import ELEMENTS, JUDGED
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.mesh.topology import distinct

Array = NDArray[np.float64]
RETREATS = 20
HEXAHEDRON = JUDGED.index(ELEMENTS["hexahedron"])


class Region:
    """The stars of some free vertices.

    Attributes
    ----------
    rows : (s,) int32
        The simplices of the stars.
    moving : (f,) int
        The free vertices, in the numbers of the mesh.
    vertices : (k,) int
        These, then the others of the stars.
    simplices : (s, d+1) int32
        The simplices of the stars, with the vertices numbered as in `vertices`.
    elements : Judged or None
        The elements with a free vertex; None: they are the simplices.
    """

    def __init__(self, mesh: kernels.Connectivity, free: NDArray[np.bool_]) -> None:
        self.rows = np.flatnonzero(free[mesh.simplices].any(axis=1)).astype(np.int32)
        simplices = mesh.simplices[self.rows]
        rim = np.zeros(len(free), dtype=bool)
        rim[simplices] = True
        self.moving = np.flatnonzero(free)
        self.vertices = np.concatenate([self.moving, np.flatnonzero(rim & ~free)])
        number = np.full(len(free), -1, dtype=np.int32)
        number[self.vertices] = np.arange(len(self.vertices), dtype=np.int32)
        self.simplices = number[simplices]
        self.elements = None if mesh.simplicial else Judged(mesh, distinct(mesh.owners[self.rows]))
        self._mesh, self._number = mesh, number

    @property
    def global_simplices(self) -> NDArray[np.int32]:
        """(s, d+1) int32: the simplices of the stars in the numbers of the mesh; made each time, as they are large."""
        return self._mesh.simplices[self.rows]

    def hexahedra(self) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
        """Return the vertices (k + r,) with those of hexahedra that are not in the stars, and the nodes of these.

        Returns
        -------
        vertices : (k + r,) int
            In the numbers of the mesh.
        nodes : (e, 8) int32
            Of each of the elements, in the numbers of these vertices, or -1 if it is no hexahedron; (0, 8): none is.
        """
        if self.elements is None:
            return self.vertices, np.empty((0, 8), dtype=np.int32)
        rows = self.elements.rows
        found = self._mesh.codes[rows] == HEXAHEDRON
        if not found.any():
            return self.vertices, np.empty((0, 8), dtype=np.int32)
        nodes = self._mesh.nodes[self._mesh.node_offsets[rows[found], None] + np.arange(8)]
        more = np.unique(nodes[self._number[nodes] < 0])
        number = self._number.copy()
        number[more] = len(self.vertices) + np.arange(len(more), dtype=np.int32)
        table = np.full((len(rows), 8), -1, dtype=np.int32)
        table[found] = number[nodes]
        return np.concatenate([self.vertices, more]), table

    def retreated(self, start: Array, moved: Array, least: float, threads: int) -> Array:
        """Return moved points (n, d) where no element of the region is inverted, and none gets very small.

        The vertices of what is inverted, or smaller than the least measure, go back half of the way, again and again.

        Parameters
        ----------
        start : (n, d) float64
            Where all are valid; returned where nothing else is.
        moved : (n, d) float64
            Returned, itself, where all are valid.
        least : float
            Of the corner simplices, in model units.
        threads : int
        """
        way, share, simplices = moved - start, np.ones((len(start), 1)), self.global_simplices
        for _ in range(RETREATS):
            measure, valid = kernels.measure(moved, simplices, threads)
            wrong = simplices[(valid == 0) | (measure < least)]
            if self.elements is not None:
                inverted = self.elements.vertices(self.elements.check(moved, threads)[0])
                wrong = np.concatenate([wrong.ravel(), inverted])
            if not wrong.size:
                return moved
            share[np.unique(wrong)] *= 0.5
            moved = np.where(share < 1, start + share * way, moved)
        return start
