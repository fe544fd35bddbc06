"""Determinants of simplices by exact rational arithmetic, from the very bits of their points."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

DOUBTFUL = 1e-12  # of the product of the edges: rounding makes less than a hundredth of it


def determinant(corners: Sequence[Sequence[float]]) -> Fraction:
    """Return d! times the signed measure of a simplex with corners (d+1, d)."""
    p = [[Fraction(x) for x in corner] for corner in corners]
    edges = [[x - y for x, y in zip(q, p[0], strict=True)] for q in p[1:]]
    if len(edges) == 2:
        (a, b), (c, d) = edges
        return a * d - b * c
    (a, b, c), (d, e, f), (g, h, i) = edges
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def signs(points: NDArray[np.floating], cells: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return 1, 0 or -1 for each simplex (m, d+1): the sign of its exact determinant."""
    corners = np.asarray(points, dtype=np.float64)[cells]
    edges = corners[:, 1:] - corners[:, :1]
    det, product = np.linalg.det(edges), np.linalg.norm(edges, axis=2).prod(axis=1)
    result = np.sign(det).astype(np.int64)
    for row in np.flatnonzero(np.abs(det) <= DOUBTFUL * product):
        exact = determinant(corners[row].tolist())
        result[row] = (exact > 0) - (exact < 0)
    return result
