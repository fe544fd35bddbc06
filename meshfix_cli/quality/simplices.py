"""The formulas of the metrics for simplices: for each of `metrics.METRICS` one function of its name.

A formula takes edges (m, d, d) float64, of which edges[:, k] leads from vertex 0 of a simplex to vertex k+1, and signed
measures (m,), and gives values (m,). Lengths are in model units, d is 2 or 3.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels

Array = NDArray[np.float64]


def numbered(nodes: Array) -> tuple[Array, NDArray[np.int32]]:
    """Return nodes (k, nodes, d) as points (n, d), and rows (k, nodes) of their numbers, as the kernels take them."""
    points = nodes.reshape(-1, nodes.shape[2])
    return points, np.arange(len(points), dtype=np.int32).reshape(nodes.shape[:2])


def _lengths(edges: Array) -> Array:
    """Lengths (m, d+1, d+1) of the edges between all pairs of vertices."""
    vertices = np.concatenate([np.zeros_like(edges[:, :1]), edges], axis=1)
    return np.linalg.norm(vertices[:, :, None] - vertices[:, None], axis=3)


def _facets(edges: Array) -> Array:
    """Lengths or areas (m, d+1) of the facets opposite the vertices."""
    lengths = _lengths(edges)
    if edges.shape[2] == 2:
        return np.stack([lengths[:, 1, 2], lengths[:, 0, 2], lengths[:, 0, 1]], axis=1)
    a, b, c = edges[:, 0], edges[:, 1], edges[:, 2]
    normals = [np.cross(b - a, c - a), np.cross(b, c), np.cross(a, c), np.cross(a, b)]
    return np.stack([np.linalg.norm(normal, axis=1) / 2 for normal in normals], axis=1)


def _longest(edges: Array) -> Array:
    return _lengths(edges).max(axis=(1, 2))


def _inradius(edges: Array, measure: Array) -> Array:
    """Radius of the inscribed sphere; 0 where the simplex is inverted."""
    return np.maximum(measure, 0.0) * edges.shape[2] / _facets(edges).sum(axis=1)


def _circumradius(edges: Array, measure: Array) -> Array:
    lengths = _lengths(edges)
    if edges.shape[2] == 2:
        return lengths[:, 0, 1] * lengths[:, 0, 2] * lengths[:, 1, 2] / (4 * measure)
    products = [lengths[:, 0, i] * lengths[:, j, k] for i, j, k in ((1, 2, 3), (2, 1, 3), (3, 1, 2))]
    a, b, c = products
    return np.sqrt((a + b + c) * (a + b - c) * (a - b + c) * (b + c - a)) / (24 * measure)


def min_angle(edges: Array, measure: Array) -> Array:
    """Return the smallest angle, dihedral for tetrahedra, in degrees and without sign."""
    del measure
    nodes = np.concatenate([np.zeros_like(edges[:, :1]), edges], axis=1)
    return np.degrees(kernels.angles(*numbered(nodes), 1)[0])


def min_sine(edges: Array, measure: Array) -> Array:
    """Return the smallest sine of an angle, with the sign of the measure. Source: equation (3.2)."""
    lengths, facets, d = _lengths(edges), _facets(edges), edges.shape[2]
    if d == 2:
        pairs = [lengths[:, i, j] * lengths[:, i, k] for i, j, k in ((0, 1, 2), (1, 0, 2), (2, 0, 1))]
        return 2 * measure / np.max(pairs, axis=0)
    # Faces i and j meet in the edge between the other two vertices.
    shares = []
    for i, j in combinations(range(4), 2):
        k, m = {0, 1, 2, 3} - {i, j}
        shares.append(lengths[:, k, m] / (facets[:, i] * facets[:, j]))
    return 1.5 * measure * np.min(shares, axis=0)


def aspect_ratio(edges: Array, measure: Array) -> Array:
    """Return the longest edge by the inradius, 1 for the regular simplex."""
    factor = 2 * (np.sqrt(3) if edges.shape[2] == 2 else np.sqrt(6))
    return _longest(edges) / (factor * _inradius(edges, measure))


def scaled_jacobian(edges: Array, measure: Array) -> Array:
    """Return the Jacobian by the edges at the worst corner, 1 for the regular simplex."""
    lengths, d = _lengths(edges), edges.shape[2]
    corners = [np.prod([lengths[:, i, j] for j in range(d + 1) if j != i], axis=0) for i in range(d + 1)]
    unit, factorial = (2 / np.sqrt(3), 2) if d == 2 else (np.sqrt(2), 6)
    return unit * factorial * measure / np.max(corners, axis=0)


def shape(edges: Array, measure: Array) -> Array:
    """Return the measure by the mean square of the edges, 1 for the regular simplex and 0 where it is inverted."""
    squares, positive = (_lengths(edges) ** 2).sum(axis=(1, 2)) / 2, np.maximum(measure, 0.0)
    if edges.shape[2] == 2:
        return 4 * np.sqrt(3) * positive / squares
    return 12 * (3 * positive) ** (2 / 3) / squares


mean_ratio = shape  # as it is called for simplices


def radius_ratio(edges: Array, measure: Array) -> Array:
    """Return the circumradius by d inradii, 1 for the regular simplex and infinite where it is inverted."""
    ratio = _circumradius(edges, measure) / (edges.shape[2] * _inradius(edges, measure))
    return np.where(measure > 0, ratio, np.inf)
