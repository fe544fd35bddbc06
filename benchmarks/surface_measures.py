"""Measures of triangulated surfaces: angles, folds, and how far two of them lie apart."""

from __future__ import annotations

import numpy as np
from exact_surfaces import Points
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from surface_bodies import Body, Cells, areas

NEAREST = 8  # triangles looked at first
BATCH = 2000  # places at once


def folds(body: Body, points: Points) -> int:
    """Count the triangles that face away from the exact normal at their middles, with points (n, 3) of a body."""
    return int(((areas(points, body.cells) * body.normals_of_cells(points)).sum(axis=1) <= 0).sum())


def volume(points: Points, cells: Cells) -> float:
    """Return the volume inside a closed surface."""
    a, b, c = (points[cells] - points.mean(axis=0)).transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


def apart(points: Points, others: Points, cells: Cells, parts: int = 6) -> tuple[float, float]:
    """Return how far the first surface is from the second at most, and the second from the first, in model units.

    Parameters
    ----------
    points, others : (n, 3) float64
        Of surfaces with the same triangles.
    cells : (m, 3) int64
        One that names a point twice is an edge.
    parts : int
        An edge is cut into so many: the samples are the corners of what that makes of a triangle.
    """
    there = farthest(samples(points, cells, parts), others, cells)
    return there, farthest(samples(others, cells, parts), points, cells)


def farthest(places: Points, points: Points, cells: Cells) -> float:
    """Return the largest distance of places (k, 3) from a surface, in model units.

    The exact distances are looked for in the order of bounds; those that cannot be the largest are left out.
    """
    surface = Triangles(points, cells)
    bounds = surface.bounds(places)
    order = np.argsort(-bounds)
    most = 0.0
    for first in range(0, len(order), BATCH):
        rows = order[first : first + BATCH]
        if bounds[rows[0]] <= most:
            break
        most = max(most, float(surface.distances(places[rows], bounds[rows]).max()))
    return most


def samples(points: Points, cells: Cells, parts: int) -> Points:
    """Return points (k, 3) in a regular pattern on triangles, their corners and edges included."""
    i, j = (x.ravel() for x in np.mgrid[0 : parts + 1, 0 : parts + 1])
    weights = np.column_stack([i, j, parts - i - j])[i + j <= parts] / parts
    return np.unique(np.einsum("wk,mkd->mwd", weights, points[cells]).reshape(-1, 3), axis=0)


class Triangles:
    """A surface, with those triangles together whose sizes are alike."""

    def __init__(self, points: Points, cells: Cells) -> None:
        self.corners = points[cells]
        middles = self.corners.mean(axis=1)
        reach = np.linalg.norm(self.corners - middles[:, None], axis=2).max(axis=1)
        sizes = np.ceil(np.log2(np.maximum(reach / np.median(reach), 1.0)))
        self.alike = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
        self.trees = [cKDTree(middles[rows]) for rows in self.alike]
        self.reach = [float(reach[rows].max()) for rows in self.alike]

    def bounds(self, places: Points) -> NDArray[np.float64]:
        """Return the distances (k,) of places from the triangles whose middles are nearest."""
        found = np.full(len(places), np.inf)
        for rows, tree in zip(self.alike, self.trees, strict=True):
            found = np.minimum(found, np.sqrt(_squared(places, self.corners[rows[tree.query(places)[1]]])))
        return found

    def distances(self, places: Points, bounds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances (k,) of places from the surface, of which bounds (k,) are known.

        Triangles are looked at whose middles are nearest; then, where another one could be closer, more of them.
        """
        found = bounds.copy()
        for alike, tree, reach in zip(self.alike, self.trees, self.reach, strict=True):
            count, left = NEAREST, np.arange(len(places))
            while len(left):
                which = [*range(count // 2 + 1 if count > NEAREST else 1, min(count, len(alike)) + 1)]
                far, rows = tree.query(places[left], k=which)
                one, rank = np.nonzero(far - reach < found[left, None])
                closer = np.sqrt(_squared(places[left[one]], self.corners[alike[rows[one, rank]]]))
                np.minimum.at(found, left[one], closer)
                left = left[far[:, -1] - reach < found[left]] if count < len(alike) else left[:0]
                count *= 2
        return found


def _squared(places: Points, corners: Points) -> NDArray[np.float64]:
    """Return the squared distances (k,) of places (k, 3) from a triangle (k, 3, 3) each."""
    apart = places[:, None] - corners
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.maximum((edges**2).sum(axis=2), 1e-300)
    shares = np.clip((apart * edges).sum(axis=2) / lengths, 0.0, 1.0)
    to_edges = ((apart - shares[..., None] * edges) ** 2).sum(axis=2).min(axis=1)
    normals = np.cross(edges[:, 0], edges[:, 1])
    squares = (normals**2).sum(axis=1)
    to_planes = (apart[:, 0] * normals).sum(axis=1) ** 2 / np.maximum(squares, 1e-300)
    inside = (np.cross(edges, apart) * normals[:, None]).sum(axis=2).min(axis=1) >= 0
    return np.where(inside & (squares > 0), np.minimum(to_planes, to_edges), to_edges)
