"""The surface on which the vertices of a tangled one lie: that of the points alone, whatever their order.

A vertex that left its place along a surface is still on it, so that all vertices together sample it, folded as the
elements between them may be.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.sides import frames_of

Array = NDArray[np.float64]
NEAREST = 16  # points to which a quadric with its 6 coefficients is fitted
SMOOTH = 0.1  # of their size: of what is no quadric to this, such as an edge, nothing is told


def refitted(points: Array, rows: NDArray[np.integer], normals: Array, sample: Array, seen: Array) -> Array:
    """Return points (k, 3) of which some have come, along their normals, to the surface that a sample is of.

    It is a quadric of least squares through the nearest points of the sample that are seen from the same side.

    Parameters
    ----------
    points : (k, 3) float64
    rows : (r,) int
        Those that move.
    normals : (k, 3) float64
        Unit vectors.
    sample, seen : (k, 3) float64
        Points, and the normals of the surface there.
    """
    from scipy.spatial import cKDTree

    count = min(NEAREST, len(sample))
    if len(rows) == 0 or count < 7:
        return points
    here, up = points[rows], normals[rows]
    _, near = cKDTree(sample).query(here, count)
    local = np.einsum("rik,rjk->rji", frames_of(up), sample[near] - here[:, None])
    size = np.sqrt((local**2).sum(axis=2).max(axis=1))
    local = local / size[:, None, None]
    x, y, z = np.moveaxis(local, 2, 0)
    weights = np.exp(-4 * (x**2 + y**2)) * ((seen[near] * up[:, None]).sum(axis=2) > 0)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    left = np.einsum("rj,rji,rjk->rik", weights, terms, terms) + 1e-9 * np.eye(6)
    right = np.einsum("rj,rji,rj->ri", weights, terms, z)
    found = np.linalg.solve(left, right[:, :, None])[:, :, 0]
    rest = (weights * (z - np.einsum("rji,ri->rj", terms, found)) ** 2).sum(axis=1) / weights.sum(axis=1).clip(1e-300)
    height = np.where((np.sqrt(rest) < SMOOTH) & (np.abs(found[:, 0]) < 1), found[:, 0] * size, 0.0)
    result = points.copy()
    result[rows] += height[:, None] * up
    return result
