"""Surfaces in space of which the exact shape is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.curved import Smooth
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.surface import laid_by_default
from meshfix_cli.solve.perturb import perturb

Array = NDArray[np.float64]
Rows = NDArray[np.int32]


def torus(
    around: int = 36, across: int = 18, jitter: float = 0.25, quads: bool = False, seed: int = 0
) -> tuple[Array, Rows]:
    """Return the points of a torus of radii 2 and 0.8, moved by a share of the steps along it, and its elements."""
    random = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    u = i + jitter * random.uniform(-1, 1, i.shape)
    v = j + jitter * random.uniform(-1, 1, i.shape)
    points = on_torus(2 * np.pi * u / around, 2 * np.pi * v / across).reshape(-1, 3)

    def at(a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
        return ((a % around) * across + b % across).ravel()

    corners = np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], axis=1).astype(np.int32)
    return points, corners if quads else np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def on_torus(a: Array, b: Array) -> Array:
    """Return points (..., 3) by the angles around the axis and around the tube."""
    wide = 2 + 0.8 * np.cos(b)
    return np.stack([wide * np.cos(a), wide * np.sin(a), 0.8 * np.sin(b)], axis=-1)


def off_torus(points: Array) -> Array:
    """Return how far points (n, 3) are from it."""
    return np.abs(np.hypot(np.hypot(points[:, 0], points[:, 1]) - 2, points[:, 2]) - 0.8)


def bumps(n: int = 20, seed: int = 0) -> tuple[Array, Rows]:
    """Return an open surface z = f(x, y) of triangles over a square of n steps, its inner points moved along it."""
    random = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    inner = (i > 0) & (i < n) & (j > 0) & (j < n)
    x, y = (one + 0.25 * inner * random.uniform(-1, 1, one.shape) for one in (i, j))
    points = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = corner, corner + n + 1, corner + n + 2, corner + 1
    return points, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)


def height(x: Array, y: Array) -> Array:
    """Return that of the bumps."""
    return 1.5 * np.sin(x / 3) * np.cos(y / 4)


def box(n: int = 6, triangles: bool = False) -> tuple[Array, Rows]:
    """Return the surface of a cube of n quadrilaterals along each edge, of size 1 each, seen from outside."""
    number: dict[tuple[int, ...], int] = {}
    rows = []
    for axis in range(3):
        for side in (0, n):
            for i in range(n):
                for j in range(n):
                    row = []
                    for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                        place = [0, 0, 0]
                        place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3] = side, a, b
                        row.append(number.setdefault(tuple(place), len(number)))
                    rows.append(row if side else row[::-1])
    quads = np.array(rows, dtype=np.int32)
    elements = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if triangles else quads
    return np.array(list(number), dtype=np.float64), elements


def moebius(n: int = 24, wide: int = 3) -> tuple[Array, Rows]:
    """Return a Moebius band of triangles."""
    i, j = np.meshgrid(np.arange(n), np.arange(wide + 1), indexing="ij")
    angle, across = 2 * np.pi * i / n, (j / wide - 0.5)
    out = 2 + across * np.cos(angle / 2)
    points = np.stack([out * np.cos(angle), out * np.sin(angle), across * np.sin(angle / 2)], axis=-1).reshape(-1, 3)

    def at(a: int, b: int) -> int:
        return (a % n) * (wide + 1) + (wide - b if a >= n else b)

    rows = []
    for a in range(n):
        for b in range(wide):
            rows += [(at(a, b), at(a + 1, b), at(a + 1, b + 1)), (at(a, b), at(a + 1, b + 1), at(a, b + 1))]
    return points, np.array(rows, dtype=np.int32)


def three_sheets(n: int = 4) -> tuple[Array, Rows]:
    """Return three flat sheets of n x n quadrilaterals that meet in one edge, along z."""
    number: dict[tuple[int, int, int], int] = {}
    points: list[Array] = []
    rows = []
    for sheet in range(3):
        way = np.array([np.cos(2.1 * sheet), np.sin(2.1 * sheet), 0.0])
        for i in range(n):
            for j in range(n):
                row = []
                for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                    key = (sheet if a else 0, a, b)
                    if key not in number:
                        number[key] = len(points)
                        points.append(a * way + [0, 0, b])
                    row.append(number[key])
                rows.append(row)
    return np.array(points), np.array(rows, dtype=np.int32)


def laid(points: Array, rows: Rows, reference: Array | None = None) -> Mesh:
    """Return a surface of triangles or quadrilaterals whose vertices slide on it, within 0.03 of its edges."""
    mesh = Mesh.build(points, rows if rows.shape[1] == 3 else [("quad", rows)])
    before = None if reference is None else mesh.along_curve(reference)
    return laid_by_default(mesh, Smooth(40.0, 0.03 * mesh.mean_edge_length()), before)


def tangled(points: Array, rows: Rows, seed: int = 0) -> Array:
    """Return the points with 25 % of all moved along the surface by 1.5 edges, those inside of its patches."""
    mesh = laid(points, rows)
    return perturb(mesh, 25, 1.5 * mesh.mean_edge_length(), seed)[0].points


def spoiled(random: np.random.Generator) -> tuple[Array, Rows]:
    """Return a small surface, closed or open, some points of which are where others are, or between two, or astray."""
    which = random.integers(3)
    if which == 0:
        points, rows = box(int(random.integers(1, 4)), triangles=True)
    elif which == 1:
        points, rows = bumps(int(random.integers(2, 6)))
    else:
        points = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
        rows = np.array([[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]], dtype=np.int32)
    for row in random.choice(len(points), int(random.integers(1, 2 + len(points) // 4)), replace=False):
        one, other = points[random.integers(len(points), size=2)]
        points[row] = (one, (one + other) / 2, points[row] + 0.5 * random.standard_normal(3))[random.integers(3)]
    return points, rows
