"""UGRID files in text and binary, and meshio as another reader."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import shapes
from files_medit import surface
from numpy.typing import NDArray

Blocks = dict[str, NDArray[np.int64]]
KEYS = ("triangle", "quad", "tetra", "pyramid", "wedge", "hexahedron")
PYRAMID = [1, 0, 4, 2, 3]


def parts(points: NDArray[np.float64], blocks: Blocks, labels: NDArray[np.int64]) -> list[Any]:
    """Counts, coordinates and integers; the labels are of triangles, then of quadrilaterals."""
    rows = [blocks.get(key, np.empty((0, 1), dtype=np.int64)) + 1 for key in KEYS]
    rows[3] = rows[3][:, PYRAMID] if len(rows[3]) else rows[3]
    counts = np.array([len(points), *map(len, rows)])
    return [
        counts,
        points,
        np.concatenate([*(row.ravel() for row in rows[:2]), labels, *(r.ravel() for r in rows[2:])]),
    ]


def binary(kind: str, points: NDArray[np.float64], blocks: Blocks, labels: NDArray[np.int64]) -> bytes:
    """`kind` is what stands in names: l for little endian, b or r, bytes of a coordinate, l for long integers."""
    order = "<" if kind.startswith("l") else ">"
    integer, real = f"{order}i{8 if kind.endswith('l') else 4}", f"{order}f{4 if '4' in kind else 8}"
    counts, coordinates, listed = parts(points, blocks, labels)
    records = [counts.astype(integer).tobytes(), coordinates.astype(real).tobytes() + listed.astype(integer).tobytes()]
    if "r" in kind:
        records = [(m := np.array(len(one), f"{order}i4").tobytes()) + one + m for one in records]
    return b"".join(records)


def text(points: NDArray[np.float64], blocks: Blocks, labels: NDArray[np.int64]) -> str:
    counts, coordinates, listed = parts(points, blocks, labels)
    lines = [" ".join(map(str, counts.tolist())), *(" ".join(map(repr, row)) for row in coordinates.tolist())]
    words = list(map(str, listed.tolist()))
    return "\n".join([*lines, *(" ".join(words[at : at + 7]) for at in range(0, len(words), 7)), ""])


def content() -> tuple[NDArray[np.float64], Blocks, NDArray[np.int64]]:
    points, cells = shapes.block()
    skin = surface(cells)
    return points, {"triangle": skin, "tetra": cells}, np.arange(len(skin)) % 3 + 1


def write(kind: str, path: Path) -> None:
    path.write_bytes(binary(kind, *content()))


def plain(path: Path) -> None:
    path.write_text(text(*content()))


FILES: dict[str, Callable[[Path], None]] = {
    "text.ugrid": plain,
    **{
        f"mesh.{kind}.ugrid": partial(write, kind)
        for kind in ("b8", "lb8", "b4", "lb4", "r8", "lr8", "r4", "lr4", "b8l", "lb8l")
    },
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3) and the rest; the name tells how meshio reads it."""
    if path.name.endswith("text.ugrid"):
        words = path.read_text().split()
        n = 3 * int(words[0])
        return np.array(words[7 : 7 + n], dtype=float).reshape(-1, 3), {"rest": [words[:7], words[7 + n :]]}
    mesh = meshio.read(path)
    return mesh.points.astype(float), {"cells": [run.data for run in mesh.cells], **mesh.cell_data}
