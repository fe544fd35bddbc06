"""Files of GetFEM as it writes them, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material
from numpy.typing import NDArray


def file(
    points: NDArray[np.float64], convexes: Sequence[tuple[str, Sequence[int]]], regions: str = "", told: bool = True
) -> str:
    """Transformations and points of convexes; `told`: the counts are, as newer versions tell them."""
    listed = ["% GETFEM MESH FILE ", "% GETFEM VERSION 5.4.2", "", "BEGIN POINTS LIST", ""]
    listed += [f"  POINT COUNT {len(points)}"] * told
    listed += ["  ".join([f"  POINT  {i}", *map(repr, point)]) for i, point in enumerate(points.tolist())]
    listed += ["", "END POINTS LIST", "", "BEGIN MESH STRUCTURE DESCRIPTION", ""]
    listed += [f"  CONVEX COUNT {len(convexes)}"] * told
    listed += [f"  CONVEX {i}    '{name}'      {'  '.join(map(str, row))}" for i, (name, row) in enumerate(convexes)]
    return "\n".join([*listed, "", "END MESH STRUCTURE DESCRIPTION", "", regions])


def region(number: int, members: Sequence[str]) -> str:
    return f"BEGIN REGION {number}\n{' '.join(members)}\nEND REGION {number}\n"


def solid(path: Path) -> None:
    points, cells = shapes.block()
    inside = np.flatnonzero(material(points, cells) == 2)
    regions = region(7, list(map(str, inside.tolist()))) + region(8, ["0/0", "1/3"])
    path.write_text(file(points, [("GT_PK(3,1)", row) for row in cells.tolist()], regions))


def plane(path: Path) -> None:
    """Without counts, as older versions write; lines that end as on Windows."""
    points, cells = shapes.plate()
    text = file(points[:, :2], [("GT_PK(2,1)", row) for row in cells.tolist()], told=False)
    path.write_bytes(text.replace("\n", "\r\n").encode())


FILES: dict[str, Callable[[Path], None]] = {"solid.mesh": solid, "plane.mesh": plane}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other words."""
    rows = [line.split() for line in path.read_text().splitlines()]
    mine = [row for row in rows if row[:1] == ["POINT"] and row[1] != "COUNT"]
    points = np.array([row[2:] for row in mine], dtype=float)
    rest = [row[:2] if row in mine else row for row in rows]
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]), {"rest": rest}
