"""Meshes of Elmer as programs write them, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, rows, surface
from numpy.typing import NDArray

TYPES = {2: 202, 3: 303, 4: 504}


def folder(path: Path, points: NDArray[np.float64], cells: NDArray[np.int64], of: NDArray[np.int64]) -> None:
    """Write a mesh whose elements have bodies, and its boundary in two parts."""
    path.mkdir()
    skin = surface(cells)
    size = cells.shape[1]
    counts = [(TYPES[size - 1], len(skin)), (TYPES[size], len(cells))]
    (path / "mesh.header").write_text(f"{len(points)} {len(cells)} {len(skin)}\n2\n{rows(counts)}")
    (path / "mesh.nodes").write_text(rows([i, -1, *(f"{x:.6f}" for x in p)] for i, p in enumerate(points, 1)))
    body = ([i, b, TYPES[size], *(c + 1)] for i, (b, c) in enumerate(zip(of, cells, strict=True), 1))
    (path / "mesh.elements").write_text(rows(body))
    facets = ([i, 1 + i % 2, 1, 0, TYPES[size - 1], *(c + 1)] for i, c in enumerate(skin, 1))
    (path / "mesh.boundary").write_text(rows(facets))


def solid(path: Path) -> None:
    points, cells = shapes.block()
    folder(path, points, cells, material(points, cells))
    (path / "mesh.names").write_text(
        "! ----- names for bodies -----\n$ steel = 1\n$ copper = 2\n! ----- names for boundaries -----\n$ wall = 2\n"
    )


def plane(path: Path) -> None:
    points, cells = shapes.plate()
    folder(path, points, cells, np.ones(len(cells), dtype=np.int64))


FILES: dict[str, Callable[[Path], None]] = {"solid": solid, "plane": plane}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and what stands before them in their lines."""
    lines = [line.split() for line in (path / "mesh.nodes").read_text().splitlines()]
    return np.array([words[2:] for words in lines], dtype=float), {"numbers": [words[:2] for words in lines]}
