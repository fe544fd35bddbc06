"""Quality by the shapes that the elements have in a reference, instead of the regular one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.mesh import Mesh

Array = NDArray[np.float64]


def mean_ratios(points: Array, reference: Array, simplices: NDArray[np.int32]) -> Array:
    """Return the mean ratio of each simplex as if that of the reference were the regular one.

    Parameters
    ----------
    points, reference : (n, d) float64
    simplices : (m, d+1) int32

    Returns
    -------
    (m,) float64
        d det(T)^(2/d) / |T|^2, T = A W^-1 with the edges A and those of the
        reference W: 1 where only position and size differ, 0 where the simplex is inverted. Source: P. Knupp,
        "Algebraic mesh quality metrics", SIAM Journal on Scientific Computing 23 (2001).
    """
    d, here, there = points.shape[1], points[simplices], reference[simplices]
    maps = np.linalg.solve(there[:, 1:] - there[:, :1], here[:, 1:] - here[:, :1])  # the transpose of T
    mirrored = np.sign(np.linalg.det(there[:, 1:] - there[:, :1]))  # where a whole part is
    det = np.maximum(np.linalg.det(maps) * mirrored, 0.0)
    square = (maps**2).sum(axis=(1, 2))
    return np.divide(d * det ** (2 / d), square, out=np.zeros_like(det), where=square > 0)


def worst_and_mean_to(mesh: Mesh, reference: Array, threads: int = 1) -> tuple[float, float]:
    """Return the smallest and the mean over the elements; the reference (k, d) is in the order of the connectivity.

    That of a simplex is its mean ratio, that of another element the smallest of its corners, or 0 where it is not valid
    inside.
    """
    connectivity, points = mesh.topology.connectivity, mesh.along_curve(mesh.points)
    values = mean_ratios(points, reference, connectivity.simplices)
    if not mesh.topology.simplicial:
        verdicts = mesh.judged().judge(points, threads)[0]
        values = np.minimum.reduceat(values, connectivity.simplex_offsets[:-1])
        values[verdicts != VALID] = 0.0
    return float(values.min()), float(values.mean())
