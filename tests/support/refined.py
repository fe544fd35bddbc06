"""Elements of second or higher order made of linear ones: more nodes, each where the straight element has it."""

from __future__ import annotations

import numpy as np
from building import Blocks, Points
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import element_of

# What each linear type becomes; complete ones have nodes inside of faces, and of themselves.
SERENDIPITY = {
    "triangle": "triangle6", "quad": "quad8", "tetra": "tetra10", "pyramid": "pyramid13", "wedge": "wedge15",
    "hexahedron": "hexahedron20",
}  # fmt: skip
COMPLETE = {**SERENDIPITY, "quad": "quad9", "pyramid": "pyramid19", "wedge": "wedge18", "hexahedron": "hexahedron27"}


def refined(points: Points, cells: Blocks, types: dict[str, str]) -> tuple[Points, Blocks]:
    """Points (n, d) and elements with as many more as their types have nodes; those of no other type stay as they are.

    A node is that of its place between corners, whichever element has it: neighbours share it, and facets beside them.
    """
    number: dict[tuple[int, ...], int] = {}
    blocks: Blocks = []
    for key, rows in cells:
        element = element_of(types.get(key, key))
        assert element is not None
        nodes = [
            [number.setdefault(place, len(points) + len(number)) for place in map(tuple, _places(rows, weights))]
            for weights in element.weights
        ]
        others = np.array(nodes, dtype=np.int32).reshape(-1, len(rows)).T
        blocks.append((element.key, np.column_stack([rows, others]).astype(np.int32)))
    return with_middles(np.concatenate([points, np.zeros((len(number), points.shape[1]))]), blocks), blocks


def _places(rows: NDArray[np.integer], weights: tuple[float, ...]) -> list[list[int]]:
    """Return the corners of a node in each element (m, c), and how many millionths of it each has."""
    some = np.flatnonzero(weights)
    corners, shares = rows[:, some], np.rint(1e6 * np.array(weights)[some]).astype(int)
    order = np.argsort(corners, axis=1)
    found: list[list[int]] = np.hstack([np.take_along_axis(corners, order, axis=1), shares[order]]).tolist()
    return found


def middles(cells: Blocks) -> dict[int, tuple[NDArray[np.integer], NDArray[np.float64]]]:
    """The corners between which each node lies that is none, and their weights."""
    found = {}
    for key, rows in cells:
        element = element_of(key)
        assert element is not None
        for place, weights in enumerate(element.weights, element.shape.corners):
            some = np.flatnonzero(weights)
            chosen = np.array(weights)[some]
            found.update(
                {node: (row, chosen) for node, row in zip(rows[:, place].tolist(), rows[:, some], strict=True)}
            )
    return found


def with_middles(points: Points, cells: Blocks) -> Points:
    """Points (n, d) with each node in the middle between its corners."""
    moved = points.copy()
    for node, (corners, weights) in middles(cells).items():
        moved[node] = weights @ points[corners]
    return moved
