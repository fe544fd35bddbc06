"""Grids of ADCIRC as programs write them, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from numpy.typing import NDArray


def file(
    points: NDArray[np.float64], cells: Sequence[Sequence[int]], boundaries: str = "", form: str = "%10d %17.8f %17.8f"
) -> str:
    """Cells by their nodes, from 1."""
    lines = ["a grid", f"{len(cells)} {len(points)} ! elements and nodes"]
    lines += [form % (i, *p[:2]) + f" {-1.5 * i:.6f}" for i, p in enumerate(points.tolist(), 1)]
    lines += [" ".join(map(str, [i, len(row), *row])) for i, row in enumerate(cells, 1)]
    return "\n".join([*lines, boundaries])


def ocean(path: Path) -> None:
    points, cells = shapes.plate()
    around = "1 = Number of open boundaries\n2 = Total number of open boundary nodes\n2 = nodes of the first\n1\n2\n"
    around += "2 = Number of land boundaries\n4 = Total number of land boundary nodes\n"
    around += "2 20\n3\n4\n2 24\n5 6 1.5 1.0 1.0\n7 8 2 1 1\n"
    path.write_text(file(points, (cells + 1).tolist(), around))


def plain(path: Path) -> None:
    """Without a word on boundaries, and with lines that end as on Windows."""
    points, cells = shapes.plate()
    path.write_bytes(file(points, (cells + 1).tolist(), form="%d\t%.12E\t%.12E").replace("\n", "\r\n").encode())


FILES: dict[str, Callable[[Path], None]] = {"fort.14": ocean, "hgrid.gr3": plain}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), of z = 0, and all other words."""
    rows = [line.split() for line in path.read_text().splitlines()]
    n = int(rows[1][1])
    points = np.array([[*map(float, row[1:3]), 0.0] for row in rows[2 : n + 2]])
    return points, {"rest": [rows[:2], [[row[0], *row[3:]] for row in rows[2 : n + 2]], rows[n + 2 :]]}
