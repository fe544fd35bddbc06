"""A part of a mesh by itself, as the methods take it that move all of its vertices at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels


class Region:
    """The stars of some free vertices.

    Attributes
    ----------
    rows : (s,) int
        The simplices of the stars.
    moving : (f,) int
        The free vertices, in the numbers of the mesh.
    vertices : (k,) int
        These, then the others of the stars.
    global_simplices : (s, d+1) int32
        The simplices of the stars, in the numbers of the mesh.
    simplices : (s, d+1) int32
        The same, with the vertices numbered as in `vertices`.
    """

    def __init__(self, mesh: kernels.Connectivity, free: NDArray[np.bool_]) -> None:
        self.rows = np.flatnonzero(free[mesh.simplices].any(axis=1))
        simplices = mesh.simplices[self.rows]
        rim = np.zeros(len(free), dtype=bool)
        rim[simplices] = True
        self.moving = np.flatnonzero(free)
        self.vertices = np.concatenate([self.moving, np.flatnonzero(rim & ~free)])
        number = np.full(len(free), -1, dtype=np.int32)
        number[self.vertices] = np.arange(len(self.vertices), dtype=np.int32)
        self.global_simplices = np.ascontiguousarray(simplices)
        self.simplices = np.ascontiguousarray(number[simplices])
