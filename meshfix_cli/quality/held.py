"""What edges between held vertices allow: no corner is better than the sine of the angle between two of its edges."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import JUDGED

if TYPE_CHECKING:
    from meshfix_cli import kernels
    from meshfix_cli.mesh.mesh import Mesh

Array = NDArray[np.float64]


def corner_weights(connectivity: kernels.Connectivity, elements: NDArray[np.integer]) -> Array:
    """Return the weights of the scaled Jacobians at corners of elements (s,), 0 for whole simplices."""
    weights = np.array([one.shape.weight if len(one.shape.simplices) > 1 else 0.0 for one in JUDGED])
    return weights[connectivity.codes[elements]]


def highest_of_corners(points: Array, corners: NDArray[np.integer], weights: Array, held: NDArray[np.bool_]) -> float:
    """Return the largest smallest scaled Jacobian that edges between held vertices (n,) allow; inf: they allow any.

    Parameters
    ----------
    points : (n, d) float64
    corners : (s, d+1) int
        Simplices, the corner first.
    weights : (s,) float64
        See `corner_weights`; what has none is left out.
    held : (n,) bool
    """
    edges = points[corners[:, 1:]] - points[corners[:, :1]]
    edges /= np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), np.finfo(float).tiny)
    least = np.inf
    for i, j in combinations(range(1, corners.shape[1]), 2):
        here = (weights > 0) & held[corners[:, [0, i, j]]].all(axis=1)
        cosine = (edges[here, i - 1] * edges[here, j - 1]).sum(axis=1)
        least = min(least, float((weights[here] * np.sqrt(np.maximum(1 - cosine**2, 0))).min(initial=np.inf)))
    return least


def highest(mesh: Mesh) -> float:
    """Return the same of all corners of a mesh whose elements are not all simplices; no vertex that slides is held."""
    connectivity, held = mesh.topology.connectivity, ~mesh.along_curve(mesh.movable)
    rows = np.flatnonzero(held[connectivity.simplices].sum(axis=1) >= 3)
    weights = corner_weights(connectivity, connectivity.owners[rows])
    return highest_of_corners(mesh.along_curve(mesh.points), connectivity.simplices[rows], weights, held)
