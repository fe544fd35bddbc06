"""Solids and plane meshes with flat boundaries, and what of them must not change, told by their coordinates alone."""

from __future__ import annotations

import numpy as np
from geometries import grid
from numpy.typing import NDArray

Points = NDArray[np.float64]
Cells = NDArray[np.int64]
Mask = NDArray[np.bool_]


def union(cells: Mask, pitch: int = 2) -> tuple[Points, Cells, NDArray[np.int64]]:
    """Simplices in the boxes of a coarse grid that are chosen (a, b, ...) bool, each of `pitch` steps along its edges.

    Returns
    -------
    points : (n, d) float64
        Whole numbers.
    simplices : (m, d+1) int
    boxes : (m,) int
        The number of the box that each is in, of all of the grid.
    """
    points, simplices = grid(*(np.arange(size * pitch + 1.0) for size in cells.shape))
    middle = (points[simplices].mean(axis=1) // pitch).astype(int)
    boxes = np.ravel_multi_index(tuple(middle.T), cells.shape)
    chosen = cells.ravel()[boxes]
    simplices, boxes = simplices[chosen], boxes[chosen]
    used = np.unique(simplices)
    number = np.zeros(len(points), dtype=np.int64)
    number[used] = np.arange(len(used))
    return points[used], number[simplices], boxes


def may_move(points: Points, solid: Mask, pitch: int = 2) -> NDArray[np.int64]:
    """Return in how many directions (n,) the points of a union may go, by the boxes around each.

    A direction is free where it does not matter to the boxes around a point: those on both sides of it are alike.
    """
    padded = np.pad(solid, 1)
    d, degrees = solid.ndim, np.zeros(len(points), dtype=np.int64)
    for i, point in enumerate(points.astype(int)):
        around = np.empty((2,) * d, dtype=bool)
        for corner in np.ndindex(around.shape):
            place = tuple((x + pitch - (not up)) // pitch for x, up in zip(point, corner, strict=True))
            around[corner] = padded[place]
        degrees[i] = sum(bool((around.take(0, axis=k) == around.take(1, axis=k)).all()) for k in range(d))
    return degrees
