"""Files of FreeFEM as it writes them, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray


def lines(rows: NDArray[Any], labels: NDArray[np.int64]) -> str:
    listed = zip(rows.tolist(), labels.tolist(), strict=True)
    return "".join(" ".join(map(repr, row)) + f" {label}\n" for row, label in listed)


def file(
    points: NDArray[np.float64], cells: NDArray[np.int64], labels: NDArray[np.int64], boundary: NDArray[np.int64]
) -> str:
    """The vertices of the boundary have the label 1, its elements 3 and 4."""
    on = np.isin(np.arange(len(points)), boundary).astype(np.int64)
    sides = np.arange(len(boundary)) % 2 + 3
    head = f"{len(points)} {len(cells)} {len(boundary)}\n"
    return head + lines(points, on) + lines(cells + 1, labels) + lines(boundary + 1, sides)


def edges(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """The edges of the boundary of triangles."""
    every = np.sort(cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found, count = np.unique(every, axis=0, return_counts=True)
    return found[count == 1]


def plane(path: Path) -> None:
    points, cells = shapes.plate()
    labels = (points[cells].mean(axis=1)[:, 0] > points[:, 0].mean()).astype(np.int64)
    path.write_text(file(points[:, :2], cells, labels, edges(cells)))


def solid(path: Path) -> None:
    """With lines that end as on Windows."""
    points, cells = shapes.block()
    text = file(points, cells, material(points, cells), surface(cells))
    path.write_bytes(text.replace("\n", "\r\n").encode())


FILES: dict[str, Callable[[Path], None]] = {"plane.msh": plane, "solid.msh": solid}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other words."""
    rows = [line.split() for line in path.read_text().splitlines()]
    n, d = int(rows[0][0]), len(rows[1]) - 1
    points = np.array([row[:d] for row in rows[1 : n + 1]], dtype=float)
    rest = {"rest": [rows[0], [row[d] for row in rows[1 : n + 1]], rows[n + 1 :]]}
    return np.column_stack([points, np.zeros((n, 3 - d))]), rest
