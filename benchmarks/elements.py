"""Valid meshes of every type of element, and tangles of them; each mesh is a function of nothing.

A mesh is (points (n, d), pairs of a type and its rows (m, nodes)), positive, in VTK's order, and all points are used.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from geometries import GEOMETRIES, circle, graded_axis, polygon
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate
from building import Blocks, Cells, Points, box, hexahedra, outer_facets, quads, scattered, stacked

Mask = NDArray[np.bool_]
SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)


def quad_grid(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[Points, Cells]:
    """Return the quads of a grid with these coordinates."""
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(points), dtype=np.int32).reshape(len(x), len(y))
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return points, np.column_stack([corner.ravel() for corner in corners])


def graded_quads() -> tuple[Points, Blocks]:
    """Return a square of quads that differ by 1e4 in area."""
    axis = graded_axis(24, 1e2)
    points, cells = quad_grid(axis, axis)
    return points, [("quad", cells)]


def quad_rings() -> tuple[Points, Blocks]:
    """Return the rings of quads between a circle and another of four times its size."""
    around, radii = 60, np.geomspace(1.0, 4.0, 25)
    points = np.concatenate([circle(0, 0, radius, around) for radius in radii])
    corner, following = np.arange(around), np.roll(np.arange(around), -1)
    ring = np.column_stack([corner, corner + around, following + around, following])
    cells = np.concatenate([ring + k * around for k in range(len(radii) - 1)])
    return points, [("quad", cells.astype(np.int32))]


def quad_plate() -> tuple[Points, Blocks]:
    """Return a plate with two holes, of irregular quads."""
    points, cells = quads(*GEOMETRIES["plate with holes"]())
    return points, [("quad", cells)]


def quads_and_triangles() -> tuple[Points, Blocks]:
    """Return squares around a square of irregular triangles."""
    steps = 7
    points, cells = quad_grid(*[np.linspace(-1, 2, 3 * steps + 1)] * 2)
    within = (points > 1e-9).all(axis=1) & (points < 1 - 1e-9).all(axis=1)
    cells = cells[(np.abs(points[cells].mean(axis=1) - 0.5) > 0.5).any(axis=1)]
    patch, triangles = polygon(1 / steps, SQUARE)
    number = np.cumsum(~within) - 1
    outer = points[~within]
    # The corners of the squares at the rim of the triangles are those that the triangles have there.
    apart = np.linalg.norm(patch[:, None] - outer, axis=2)
    shared = apart.min(axis=1) < 1e-9
    joined = np.where(shared, apart.argmin(axis=1), len(outer) + np.cumsum(~shared) - 1)
    blocks = [("quad", number[cells].astype(np.int32)), ("triangle", joined[triangles].astype(np.int32))]
    return np.concatenate([outer, patch[~shared]]), blocks


def box_of_hexahedra(count: int) -> tuple[Points, Blocks]:
    """Return a cube of about so many hexahedra."""
    side = round(count ** (1 / 3))
    return box(np.full((side, side, side), "hexahedron"), *[np.linspace(0, 1, side + 1)] * 3)


def box_of_wedges_and_tets(count: int) -> tuple[Points, Blocks]:
    """Return a cube of about so many elements: as many wedges, below, as tetrahedra."""
    side = round((count / 3) ** (1 / 3))  # two wedges in three quarters of the cells, six tetrahedra in the others
    kinds = np.full((side, side, side), "wedge")
    kinds[:, :, round(0.75 * side) :] = "tetra"
    return box(kinds, *[np.linspace(0, 1, side + 1)] * 3)


def graded_hexahedra() -> tuple[Points, Blocks]:
    """Return a cube of hexahedra that differ by a million in volume."""
    return box(np.full((10, 10, 10), "hexahedron"), *[graded_axis(10, 1e2)] * 3)


def hex_plate() -> tuple[Points, Blocks]:
    """Return a plate with two holes, of irregular quads in layers."""
    points, cells = stacked(*quads(*generate.plate(0.3)), np.linspace(0.0, 0.8, 6))
    return points, [("hexahedron", cells)]


def hex_bracket() -> tuple[Points, Blocks]:
    """Return that plate bent round: the facets are not plane."""
    points, cells = hex_plate()
    return generate.bent(points, 1.2), cells


def hex_shell() -> tuple[Points, Blocks]:
    """Return the space between two spheres, each a cube blown up."""
    cube, blocks = box(np.full((6, 6, 6), "hexahedron"), *[np.linspace(-1, 1, 7)] * 3)
    (sides,) = outer_facets(blocks)
    used, cells = np.unique(sides, return_inverse=True)
    directions = np.tan(np.pi / 4 * cube[used])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = np.geomspace(0.7, 1.0, 9)
    _, layers = stacked(np.zeros((len(used), 2)), cells.reshape(-1, 4).astype(np.int32), radii)
    return np.concatenate([radius * directions for radius in radii]), [("hexahedron", layers)]


def hexahedra_of_tets() -> tuple[Points, Blocks]:
    """Return a block of tetrahedra, each cut into four hexahedra."""
    points, cells = hexahedra(*generate.extruded(*polygon(0.3, SQUARE), np.linspace(0.0, 1.2, 5)))
    return points, [("hexahedron", cells)]


def wedge_plate() -> tuple[Points, Blocks]:
    """Return a plate with two holes, of triangles in layers."""
    points, cells = stacked(*generate.plate(0.2), np.linspace(0.0, 0.8, 6))
    return points, [("wedge", cells)]


def wedges_on_tets() -> tuple[Points, Blocks]:
    """Return a block of irregular tetrahedra with thin layers of wedges below and above."""
    plane, triangles = polygon(0.16, SQUARE)
    heights = np.array([0.0, 0.02, 0.05, 0.1, 0.25, 0.4, 0.55, 0.7, 0.75, 0.78, 0.8])
    points, cells = stacked(plane, triangles, heights)
    below, between, above = np.split(cells, [3 * len(triangles), -3 * len(triangles)])
    return points, [("wedge", np.concatenate([below, above])), ("tetra", generate.split_wedges(between))]


def hexahedra_and_wedges() -> tuple[Points, Blocks]:
    """Return a plate of squares and triangles in layers."""
    plane, blocks = quads_and_triangles()
    solid = {"quad": "hexahedron", "triangle": "wedge"}
    heights = np.linspace(0.0, 0.5, 5)
    layers = {solid[key]: stacked(plane, rows, heights) for key, rows in blocks}
    return layers["wedge"][0], [(key, rows) for key, (_, rows) in layers.items()]


def hexahedra_beside_tets() -> tuple[Points, Blocks]:
    """Return a box of hexahedra and of tetrahedra, with pyramids between them."""
    kinds = np.full((8, 6, 6), "hexahedron")
    kinds[4], kinds[5:] = "pyramid", "tetra"
    return box(kinds, np.linspace(0, 4, 9), *[np.linspace(0, 3, 7)] * 2)


def tets_within_hexahedra() -> tuple[Points, Blocks]:
    """Return a box of hexahedra around pyramids around tetrahedra."""
    kinds = np.full((7, 7, 7), "hexahedron")
    kinds[1:-1, 1:-1, 1:-1], kinds[2:-2, 2:-2, 2:-2] = "pyramid", "tetra"
    return box(kinds, *[np.linspace(0, 1, 8)] * 3)


def every_solid() -> tuple[Points, Blocks]:
    """Return a bent slab of layers: hexahedra, pyramids, tetrahedra and thin wedges, and pyramids between all."""
    kinds = np.full((9, 6, 7), "hexahedron")
    kinds[:, :, 2], kinds[:, :, 3], kinds[:, :, 4:] = "pyramid", "tetra", "wedge"
    kinds[5:, :, 3] = kinds[7:, :, 4] = "pyramid"
    heights = np.array([0.0, 0.3, 0.6, 0.9, 1.2, 1.4, 1.5, 1.55])
    points, cells = box(kinds, np.linspace(0, 3, 10), np.linspace(0, 2, 7), heights)
    return generate.bent(points, 1.2), cells


MESHES: dict[str, Callable[[], tuple[Points, Blocks]]] = {
    "graded quads": graded_quads,
    "quad rings": quad_rings,
    "quad plate": quad_plate,
    "quads and triangles": quads_and_triangles,
    "hex box": lambda: box_of_hexahedra(1000),
    "graded hexes": graded_hexahedra,
    "hex plate": hex_plate,
    "hex bracket": hex_bracket,
    "hex shell": hex_shell,
    "hexes of tets": hexahedra_of_tets,
    "wedge plate": wedge_plate,
    "wedges on tets": wedges_on_tets,
    "wedges and tets": lambda: box_of_wedges_and_tets(1500),
    "hexes and wedges": hexahedra_and_wedges,
    "hexes beside tets": hexahedra_beside_tets,
    "tets within hexes": tets_within_hexahedra,
    "every solid": every_solid,
}


def _first_hole(points: Points) -> Mask:
    x, y, radius = generate.HOLES[0]
    return np.linalg.norm(points - (x, y), axis=1) < radius + 1e-9


# Which vertices are on a hole that is turned.
HOLES: dict[str, Callable[[Points], Mask]] = {
    "quad rings": lambda points: np.linalg.norm(points, axis=1) < 1 + 1e-9,
    "quad plate": _first_hole,
    "hex shell": lambda points: np.linalg.norm(points, axis=1) < 0.7 + 1e-9,
}


def collapsed(points: Points, free: Mask) -> Points:
    """Move all that is free into one point."""
    moved = points.copy()
    moved[free] = points[free].mean(axis=0)
    return moved


def turned(points: Points, hole: Mask, degrees: float) -> Points:
    """Turn the boundary of a hole, about its middle and the z axis."""
    angle, middle = np.radians(degrees), points[hole, :2].mean(axis=0)
    turn = np.array([(np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))])
    moved = points.copy()
    moved[hole, :2] = middle + (points[hole, :2] - middle) @ turn.T
    return moved


def tangles(name: str, points: Points, free: Mask, h: float, seed: int = 0) -> dict[str, Points]:
    """Return tangled points of one of these meshes; there is a valid mesh with what is held where it is.

    Parameters
    ----------
    name : str
        A key of `MESHES`.
    points : (n, d) float64
    free : (n,) bool
        Vertices that may move; the others are on the boundary.
    h : float
        Mean length of the edges, in the units of the points.
    seed : int
    """
    ways = {
        f"P={percent} D={distance}h": scattered(points, free, percent, distance * h, seed)
        for percent, distance in ((25, 2), (100, 8))
    }
    ways["collapsed"] = collapsed(points, free)
    if name in HOLES:
        ways["hole turned by 20°"] = turned(points, HOLES[name](points), 20)
    return ways
