"""Valid meshes of many shapes for the stress suite; each is a function of nothing, made by the project alone.

A triangle mesh is (points (n, 2), cells (m, 3)), a tetrahedral one (n, 3), (m, 4).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate

Points = NDArray[np.float64]
Cells = NDArray[np.int32]


def circle(x: float, y: float, radius: float, count: int) -> Points:
    """Return the corners of a regular polygon."""
    turn = 2 * np.pi * np.arange(count) / count
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])


def polygon(h: float, *loops: Points, seed: int = 3) -> tuple[Points, Cells]:
    """Return a Delaunay mesh of edges near `h` of the region inside an odd number of the closed loops."""
    boundary = np.concatenate([_divided(loop, h) for loop in loops])
    low, high = boundary.min(axis=0), boundary.max(axis=0)
    rows, columns = np.mgrid[0 : round((high - low)[1] / (0.866 * h)) + 1, 0 : round((high - low)[0] / h) + 1]
    grid = low + np.column_stack([((columns + rows % 2 * 0.5) * h).ravel(), (rows * 0.866 * h).ravel()])
    grid += np.random.default_rng(seed).uniform(-0.2 * h, 0.2 * h, grid.shape)
    near = np.linalg.norm(grid[:, None] - boundary, axis=2).min(axis=1)
    points = np.concatenate([boundary, grid[_inside(grid, loops) & (near > 0.6 * h)]])
    cells = Delaunay(points).simplices
    return points, positive(points, cells[_inside(points[cells].mean(axis=1), loops)])


def positive(points: Points, cells: NDArray[np.integer]) -> Cells:
    """Number every simplex so that its measure is positive."""
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    negative = np.linalg.det(edges) < 0
    return np.where(negative[:, None], cells[:, [1, 0, *range(2, cells.shape[1])]], cells).astype(np.int32)


def _divided(loop: Points, h: float) -> Points:
    sides = zip(loop, np.roll(loop, -1, axis=0), strict=True)
    return np.concatenate(
        [a + np.arange(k)[:, None] / k * (b - a) for a, b in sides for k in [max(1, round(math.dist(a, b) / h))]]
    )


def _inside(points: Points, loops: Sequence[Points]) -> NDArray[np.bool_]:
    """Count the crossings of a ray to the right."""
    inside = np.zeros(len(points), dtype=bool)
    x, y = points[:, :1], points[:, 1:]
    for loop in loops:
        (ax, ay), (bx, by) = loop.T, np.roll(loop, -1, axis=0).T
        spans = (ay > y) != (by > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= (spans & (x < ax + (y - ay) / (by - ay) * (bx - ax))).sum(axis=1) % 2 == 1
    return inside


def grid(*axes: NDArray[np.float64]) -> tuple[Points, Cells]:
    """Return the simplices of a grid with these coordinates; each cell is cut from its lowest to its highest corner."""
    d, shape = len(axes), [len(axis) for axis in axes]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    number = np.arange(len(points)).reshape(shape)
    lowest = number[tuple(slice(0, -1) for _ in axes)].ravel()
    steps = [math.prod(shape[k + 1 :]) for k in range(d)]
    ways = [np.cumsum([0, *(steps[k] for k in way)]) for way in permutations(range(d))]
    return points, positive(points, np.concatenate([lowest[:, None] + way for way in ways]))


def l_shape() -> tuple[Points, Cells]:
    """Return an L-shaped plate."""
    return polygon(0.09, np.array([(0, 0), (2, 0), (2, 0.8), (0.8, 0.8), (0.8, 2), (0, 2)], dtype=float))


def notched() -> tuple[Points, Cells]:
    """Return a plate with two sharp notches."""
    corners = [(0, 0), (0.95, 0), (1, 0.6), (1.05, 0), (2, 0), (2, 1.2), (1.25, 1.2), (1.2, 0.7), (1.15, 1.2), (0, 1.2)]
    return polygon(0.08, np.array(corners, dtype=float))


def annulus() -> tuple[Points, Cells]:
    """Return a disc with a concentric hole."""
    return polygon(0.09, circle(0, 0, 1.0, 70), circle(0, 0, 0.4, 28))


def graded_square() -> tuple[Points, Cells]:
    """Return a square whose triangles differ by 1e4 in area."""
    axis = graded_axis(18, 1e2)
    return grid(axis, axis)


def graded_axis(cells: int, ratio: float) -> NDArray[np.float64]:
    """Return coordinates from 0 to 1 whose last step is `ratio` times the first."""
    steps = ratio ** (np.arange(cells) / (cells - 1))
    return np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])


def pipes() -> tuple[Points, Cells]:
    """Return a box with two pipes through it."""
    return generate.bracket(0.22, 7, angle=0.0)


def bent() -> tuple[Points, Cells]:
    """Return the box with pipes bent round."""
    return generate.bracket(0.22, 7)


def thin_plate() -> tuple[Points, Cells]:
    """Return a plate whose thickness is a hundredth of its length, in four layers."""
    return generate.extruded(*generate.plate(0.14), np.linspace(0.0, 0.03, 5))


def gear() -> tuple[Points, Cells]:
    """Return an extruded gear of eight teeth with a hole."""
    turn = 2 * np.pi * np.arange(32) / 32
    radius = np.where(np.arange(32) % 4 < 2, 1.0, 0.75)
    teeth = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    return generate.extruded(*polygon(0.16, teeth, circle(0, 0, 0.3, 12)), np.linspace(0.0, 0.8, 6))


def shell() -> tuple[Points, Cells]:
    """Return the space between two spheres."""
    golden = (1 + math.sqrt(5)) / 2
    corners = [(0, i, j * golden) for i in (-1, 1) for j in (-1, 1)]
    ball = np.array([np.roll(corner, k) for corner in corners for k in range(3)], dtype=float)
    ball = _unit(ball)
    triangles = _hull(ball)
    for _ in range(2):
        middles = {
            tuple(sorted(pair)) for row in triangles.tolist() for pair in zip(row, row[1:] + row[:1], strict=True)
        }
        ball = _unit(np.concatenate([ball, [ball[i] + ball[j] for i, j in sorted(middles)]]))
        triangles = _hull(ball)
    layers, cells = generate.extruded(np.zeros((len(ball), 2)), triangles, np.linspace(0.5, 1.0, 6))
    points = np.tile(ball, (6, 1)) * layers[:, 2:]
    return points, positive(points, cells)


def _unit(points: Points) -> Points:
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _hull(points: Points) -> Cells:
    tets = Delaunay(np.concatenate([points, np.zeros((1, 3))])).simplices
    return np.sort(tets[(tets == len(points)).any(axis=1)], axis=1)[:, :3].astype(np.int32)


def graded_cube() -> tuple[Points, Cells]:
    """Return a cube whose tetrahedra differ by a million in volume."""
    axis = graded_axis(10, 1e2)
    return grid(axis, axis, axis)


def layers() -> tuple[Points, Cells]:
    """Return a block of layers that are a hundred times as wide as they are high."""
    return grid(np.linspace(0, 1, 11), np.linspace(0, 1, 11), np.linspace(0, 0.008, 9))


def block() -> tuple[Points, Cells]:
    """Return a slender block of irregular tetrahedra."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    return generate.extruded(*polygon(0.17, corners), np.linspace(0.0, 3.0, 19))


def o_grid() -> tuple[Points, Cells]:
    """Return the rings of triangles between a circle and another of four times its size, as around a body in a flow."""
    return rings(1.0, 4.0, 120, 40)


def graded_rings() -> tuple[Points, Cells]:
    """Return rings whose triangles grow with the radius, to a thousand times in length."""
    return rings(0.5, 500.0, 60)


def rings(inner: float, outer: float, count: int, layers: int | None = None) -> tuple[Points, Cells]:
    """Return triangles between two circles; without a number of layers they are nearly equilateral."""
    if layers is None:
        layers = round(math.log(outer / inner) / math.log(1 + 2 * math.pi / count * math.sqrt(3) / 2))
    radii, corner = np.geomspace(inner, outer, layers + 1), np.arange(count)
    turn = 2 * np.pi * (corner + 0.5 * (np.arange(layers + 1)[:, None] % 2)) / count
    points = np.stack([radii[:, None] * np.cos(turn), radii[:, None] * np.sin(turn)], axis=-1).reshape(-1, 2)
    following = (corner + 1) % count
    cells = []
    for i in range(layers):
        a, b, c, d = i * count + corner, i * count + following, (i + 1) * count + corner, (i + 1) * count + following
        both = [(a, c, b), (b, c, d)] if i % 2 else [(a, c, d), (a, d, b)]
        cells += [np.column_stack(three) for three in both]
    return points, positive(points, np.concatenate(cells))


def koch() -> tuple[Points, Cells]:
    """Return the equilateral triangles inside a Koch curve."""
    outline, step = circle(0, 0, 1.0, 3), np.exp(-1j * np.pi / 3)
    curve = outline[:, 0] + 1j * outline[:, 1]
    for _ in range(3):
        third = (np.roll(curve, -1) - curve) / 3
        curve = np.column_stack([curve, curve + third, curve + third * (1 + step), curve + 2 * third]).ravel()
    h = math.sqrt(3) / 27
    rows, columns = np.mgrid[-45:46, -45:46]
    # Turned, since one of the curve's sides stands upright.
    lattice = 1.0 + h * (math.sqrt(3) / 2 * rows + 1j * (columns + rows / 2))
    points = np.column_stack([lattice.real.ravel(), lattice.imag.ravel()])
    number = np.arange(points.shape[0]).reshape(rows.shape)
    a, b, c, d = number[:-1, :-1].ravel(), number[:-1, 1:].ravel(), number[1:, :-1].ravel(), number[1:, 1:].ravel()
    cells = np.concatenate([np.column_stack([a, b, c]), np.column_stack([b, d, c])])
    cells = cells[_inside(points[cells].mean(axis=1), [np.column_stack([curve.real, curve.imag])])]
    used, cells = np.unique(cells, return_inverse=True)
    return points[used], positive(points[used], cells.reshape(-1, 3))


def airfoil() -> tuple[Points, Cells]:
    """Return an O-grid around a slender body, whose first layers are a thousandth as high as they are wide."""
    count, turn = 120, 2 * np.pi * np.arange(120) / 120
    heights = np.concatenate([[0.0], np.cumsum(5e-5 * 1.35 ** np.arange(34))])
    body = np.column_stack([np.cos(turn), 0.12 * np.sin(turn)])
    outward = _unit(np.column_stack([0.12 * np.cos(turn), np.sin(turn)]))
    far = 4 * np.column_stack([np.cos(turn), np.sin(turn)]) - body
    share = (heights / heights[-1])[:, None, None]
    points = (body + heights[:, None, None] * outward * (1 - share) + share * far).reshape(-1, 2)
    corner = np.arange(count)
    a = (np.arange(len(heights) - 1)[:, None] * count + corner).ravel()
    b = (np.arange(len(heights) - 1)[:, None] * count + (corner + 1) % count).ravel()
    cells = np.concatenate([np.column_stack([a, b, b + count]), np.column_stack([a, b + count, a + count])])
    return points, positive(points, cells)


def kuhn() -> tuple[Points, Cells]:
    """Return a cube of Kuhn's tetrahedra."""
    axis = np.linspace(0, 1, 9)
    return grid(axis, axis, axis)


def corner() -> tuple[Points, Cells]:
    """Return a square whose triangles grow away from a corner, a million times in length."""
    axis = graded_axis(36, 1e6)
    return grid(axis, axis)


def cylinder() -> tuple[Points, Cells]:
    """Return a round cylinder of irregular tetrahedra."""
    return generate.extruded(*polygon(0.2, circle(0, 0, 0.5, 16)), np.linspace(0.0, 2.0, 13))


def chamber() -> tuple[Points, Cells]:
    """Return a rectangle of irregular triangles."""
    return polygon(0.08, np.array([(0, 0), (1, 0), (1, 2), (0, 2)], dtype=float))


def graded_box() -> tuple[Points, Cells]:
    """Return a box whose tetrahedra grow along it, a thousand times in length."""
    steps = 1e3 ** (np.arange(60) / 59)
    points, cells = grid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), np.arange(61.0))
    size = np.concatenate([steps, steps[-1:]])[points[:, 2].astype(int)]
    along = np.concatenate([[0.0], np.cumsum(steps / 3)])[points[:, 2].astype(int)]
    return np.column_stack([points[:, 0] * size, points[:, 1] * size, along]), cells


GEOMETRIES: dict[str, Callable[[], tuple[Points, Cells]]] = {
    "plate with holes": lambda: generate.plate(0.13),
    "L-shaped plate": l_shape,
    "notched plate": notched,
    "annulus": annulus,
    "graded square": graded_square,
    "box with pipes": pipes,
    "bent box": bent,
    "thin plate": thin_plate,
    "gear": gear,
    "sphere shell": shell,
    "graded cube": graded_cube,
    "layers 1:100": layers,
    "block": block,
    "O-grid": o_grid,
    "rings 1:1000": graded_rings,
    "Koch": koch,
    "airfoil 1:1000": airfoil,
    "corner 1:1e6": corner,
    "Kuhn cube": kuhn,
    "box 1:1000": graded_box,
}
