"""Lengths that the edges of a mesh should have, as its boundary tells where elements have parallel edges.

The edges of a quadrilateral or a hexahedron that are parallel in the ideal one have about the same length, and so have
those of the next element behind: a whole row of elements, whose ends are fixed edges of the boundary. The graph's
Laplace equation with the inverse lengths as weights gives a grid of lines its spacing back, layers at a wall among it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.mixed import PARALLEL, smaller_ends

Array = NDArray[np.float64]
Edges = tuple[NDArray[np.int32], NDArray[np.int32]]


def inverse_lengths(
    points: Array, mesh: kernels.Connectivity, free: NDArray[np.bool_], threads: int
) -> tuple[Edges, Array]:
    """Return the edges as `Connectivity.edges` does, and a weight (e,) for each; (0,) where all are simplices.

    Parameters
    ----------
    points : (n, d) float64
    mesh : Connectivity
    free : (n,) bool
        Edges between others keep their lengths, in model units; a row that has none gets the mean of all rows.
    threads : int
    """
    if mesh.simplicial:
        none = np.empty(0, dtype=np.int32)
        return (none, none), np.empty(0)
    edges = mesh.edges(PARALLEL, threads)
    rows = mesh.rows_of_edges(PARALLEL, edges)
    one, other = smaller_ends(edges[0]), edges[1]
    known = np.flatnonzero(~(free[one] | free[other]))
    length = np.linalg.norm(points[one[known]] - points[other[known]], axis=1)
    count = np.bincount(rows[known], minlength=rows.max(initial=-1) + 1)
    total = np.bincount(rows[known], weights=length, minlength=len(count))
    mean = length.mean() if len(length) and length.any() else 1.0
    of_row = np.divide(total, count, out=np.full(len(count), mean), where=total > 0)
    return edges, (mean / of_row)[rows]
