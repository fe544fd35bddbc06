"""Lengths that the edges of a mesh should have, as its boundary tells where elements have parallel edges.

The edges of a quadrilateral or a hexahedron that are parallel in the ideal one have about the same length, and so have
those of the next element behind: a whole row of elements, whose ends are fixed edges of the boundary. The graph's
Laplace equation with the inverse lengths as weights gives a grid of lines its spacing back, layers at a wall among it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.mixed import as_edges, ends_of, parallel_edges

Array = NDArray[np.float64]


def inverse_lengths(points: Array, mesh: kernels.Connectivity, free: NDArray[np.bool_]) -> Array:
    """Return a weight for each of `mesh.neighbours`: 0 where there is no edge; (0,) where all are simplices.

    Parameters
    ----------
    points : (n, d) float64
    mesh : Connectivity
        With its stars.
    free : (n,) bool
        Edges between others keep their lengths, in model units; a row that has none gets the mean of all rows.
    """
    if mesh.simplicial:
        return np.empty(0)
    keys, rows = _rows(mesh)
    one, other = ends_of(keys)
    known = ~(free[one] | free[other])
    length = np.linalg.norm(points[one[known]] - points[other[known]], axis=1)
    count = np.bincount(rows[known], minlength=rows.max() + 1)
    total = np.bincount(rows[known], weights=length, minlength=len(count))
    mean = length.mean() if len(length) and length.any() else 1.0
    of_row = np.divide(total, count, out=np.full(len(count), mean), where=total > 0)
    here = np.repeat(np.arange(len(points), dtype=np.int64), np.diff(mesh.neighbour_offsets))
    pairs = as_edges(here, mesh.neighbours)
    at = np.minimum(np.searchsorted(keys, pairs), len(keys) - 1)
    return np.where(keys[at] == pairs, mean / of_row[rows[at]], 0.0)


def _rows(mesh: kernels.Connectivity) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the edges (e,), ascending, as one number for both ends, and the row of parallel edges of each."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    groups = list(parallel_edges(mesh))
    joined = [edges[:, [0, k]] for edges in groups for k in range(1, edges.shape[1])]
    keys = np.unique(np.concatenate([edges.ravel() for edges in groups]))
    pairs = np.searchsorted(keys, np.concatenate(joined)) if joined else np.empty((0, 2), dtype=np.int64)
    graph = coo_matrix((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(len(keys),) * 2)
    return keys, connected_components(graph, directed=False)[1]
