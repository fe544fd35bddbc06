"""Meshes of thin layers around a body, and the same with the body moved and the rest left behind."""

from __future__ import annotations

import math

import generate
import numpy as np
from geometries import positive, shell
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from meshfix_cli import Mesh

Points = NDArray[np.float64]
FIRST, GROWTH = 1e-3, 1.3  # the height of the first layer, and how much higher each is than the last
COUNTS = {2: 24, 3: 162}  # of the vertices of each surface between two layers


def turn(degrees: float, d: int = 2) -> Points:
    """The rotation in the plane of the first two axes."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix = np.eye(d)
    matrix[:2, :2] = [[c, -s], [s, c]]
    return matrix


def layered(d: int = 2) -> Mesh:
    """Layers around a circle or a sphere of radius 1; the first is 1:260 in shape in the plane, else 1:300."""
    layers, count = 24, COUNTS[d]
    radii = 1.0 + np.concatenate([[0.0], np.cumsum(FIRST * GROWTH ** np.arange(layers))])
    if d == 2:
        corner = np.arange(count)
        angle, following = 2 * np.pi * corner / count, (corner + 1) % count
        body = np.column_stack([np.cos(angle), np.sin(angle)])
        a, b = (count * np.arange(layers)[:, None] + each for each in (corner, following))
        both = [(a, a + count, b + count), (a, b + count, b)]
        cells = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in both])
    else:
        body = shell()[0][-count:]
        triangles = np.sort(ConvexHull(body).simplices, axis=1)
        _, cells = generate.extruded(np.zeros((count, 2)), triangles, radii)
    points = (radii[:, None, None] * body).reshape(-1, d)
    return Mesh.build(points, positive(points, cells))


def left_behind(mesh: Mesh, body: Points) -> Mesh:
    """The mesh with the vertices of the body at other places, and the rest where they were."""
    points = mesh.points.copy()
    points[: len(body)] = body
    return mesh.with_points(points)


def body_of(mesh: Mesh) -> Points:
    """The vertices of the body."""
    return mesh.points[: COUNTS[mesh.dimension]]


def heights(mesh: Mesh, layers: int = 2) -> Points:
    """Of the first layers, one row below the other."""
    count = COUNTS[mesh.dimension]
    rows = mesh.points[: (layers + 1) * count].reshape(layers + 1, count, -1)
    return np.linalg.norm(np.diff(rows, axis=0), axis=2)
