"""Grids of elements of second and higher order, straight ones and such whose inner nodes are moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from geometries import grid
from numpy.typing import NDArray
from refined import COMPLETE, SERENDIPITY, refined

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.quadratic import Array, Quadratic

SQUARE = np.linspace(0, 1, 4)
FAMILIES = {
    "triangle6": ("triangle", SERENDIPITY), "quad8": ("quad", SERENDIPITY), "quad9": ("quad", COMPLETE),
    "tetra10": ("tetra", SERENDIPITY), "wedge15": ("wedge", SERENDIPITY), "wedge18": ("wedge", COMPLETE),
    "hexahedron20": ("hexahedron", SERENDIPITY), "hexahedron27": ("hexahedron", COMPLETE),
}  # fmt: skip
HIGHER = {
    "triangle10": "triangle", "triangle15": "triangle", "quad16": "quad", "tetra20": "tetra", "wedge40": "wedge",
    "hexahedron64": "hexahedron",
}  # fmt: skip
FAMILIES |= {key: (kind, {kind: key}) for key, kind in HIGHER.items()}


def straight(key: str) -> tuple[Array, NDArray[np.int32]]:
    """A grid of elements of second or higher order."""
    kind, types = FAMILIES[key]
    axes = (SQUARE,) * ELEMENTS[kind].shape.dimension
    points, rows = _grid(kind, axes)
    points, blocks = refined(points, [(kind, rows)], types)
    return points, blocks[0][1]


def _grid(kind: str, axes: tuple[Array, ...]) -> tuple[Array, NDArray[np.int32]]:
    if kind in ("triangle", "tetra"):
        return grid(*axes)
    shape = tuple(map(len, axes))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    first = np.stack(np.meshgrid(*(np.arange(n - 1) for n in shape), indexing="ij"), axis=-1).reshape(-1, len(axes))
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)] if len(axes) == 2 else [
        (*base, z) for z in (0, 1) for base in ((0, 0), (1, 0), (1, 1), (0, 1))
    ]  # fmt: skip
    rows = np.stack([np.ravel_multi_index(tuple((first + c).T), shape) for c in corners], axis=1).astype(np.int32)
    if kind == "wedge":
        rows = np.concatenate([rows[:, [0, 1, 2, 4, 5, 6]], rows[:, [0, 2, 3, 4, 6, 7]]])
    return points, rows


def curved(key: str, size: float = 0.25, seed: int = 0) -> tuple[Quadratic, Array, NDArray[np.bool_]]:
    """The grid with nodes inside that are moved at random, and some of them too far; which are free."""
    points, rows = straight(key)
    quadratic = Quadratic([(key, rows)], len(points))
    inside = np.asarray(((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1))
    moved = inside & ~quadratic.corners
    random = np.random.default_rng(seed)
    points = points + size / 3 * random.uniform(-1, 1, points.shape) * moved[:, None]
    return quadratic, points, inside


def mesh_of(quadratic: Quadratic, points: Array, key: str, rows: NDArray[np.int32], free: NDArray[np.bool_]) -> Mesh:
    """A mesh of elements of one type, of which some nodes are free."""
    kind = FAMILIES[key][0]
    mesh = Mesh.build(points, [(kind, rows[:, : ELEMENTS[kind].nodes])])
    return replace(mesh, quadratic=quadratic.holding(~free, ~free & ~quadratic.corners))
