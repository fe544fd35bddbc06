"""The surface on which the vertices of a tangled one lie: that of the points alone, whatever their order.

A vertex that left its place along a surface is still on it, so that all vertices together sample it, folded as the
elements between them may be.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels

Array = NDArray[np.float64]
SMOOTH = 0.1  # of their size: of what is no quadric to this, such as an edge, nothing is told


def refitted(
    points: Array, rows: NDArray[np.integer], normals: Array, sample: Array, seen: Array, threads: int = 1
) -> Array:
    """Return points (k, 3) of which some have come, along their normals, to the surface that a sample is of.

    It is a quadric of least squares through the nearest points of the sample that are seen from the same side; see
    kernels/surface/refit.hpp.

    Parameters
    ----------
    points : (k, 3) float64
    rows : (r,) int
        Those that move.
    normals : (k, 3) float64
        Unit vectors.
    sample, seen : (k, 3) float64
        Points, and the normals of the surface there.
    threads : int
    """
    result = points.copy()
    if len(rows):
        kernels.refit(result, rows.astype(np.int32), normals, sample, seen, SMOOTH, threads)
    return result
