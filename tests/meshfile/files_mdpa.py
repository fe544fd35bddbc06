"""Kratos's files as its programs write them, and a reader of our own, word by word."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray

HEAD = (
    "Begin ModelPartData\n//  VARIABLE_NAME value\nEnd ModelPartData\n\n"
    "Begin Properties 1\n DENSITY 7.5\nEnd Properties\n"
)
TABLE = "/* Begin Nodes\n*/Begin Properties 1\nBegin Table 1 TIME FORCE_X\n0 1\nEnd Table"


def nodes(points: NDArray[np.float64], first: int = 1) -> str:
    rows = "".join(f" {i}  {x:.6f} {y:.6f} {z:.6f}\n" for i, (x, y, z) in enumerate(points, first))
    return f"Begin Nodes\n{rows}End Nodes\n\n"


def cells(kind: str, name: str, rows: NDArray[np.int64], properties: Sequence[int] | None, first: int = 1) -> str:
    """Elements, conditions or, without properties, geometries; nodes from 1."""
    marks = [""] * len(rows) if properties is None else [f"{value} " for value in properties]
    lines = (
        f"{i:8} {mark}{' '.join(map(str, row + 1))}\n"
        for i, (mark, row) in enumerate(zip(marks, rows, strict=True), first)
    )
    return f"Begin {kind} {name}// GUI group\n{''.join(lines)}End {kind}\n\n"


def plane(path: Path) -> None:
    points, triangles = shapes.plate()
    skin = surface(triangles)
    wall = "".join(f"    {i}\n" for i in np.unique(skin) + 1)
    lines = "".join(f"    {i}\n" for i in range(1, len(skin) + 1))
    path.write_text(
        HEAD + nodes(points) + cells("Elements", "Element2D3N", triangles, [1] * len(triangles))
        + cells("Conditions", "LineCondition2D2N", skin, [0] * len(skin))
        + f"Begin SubModelPart Walls // of the plate\n  Begin SubModelPartNodes\n{wall}  End SubModelPartNodes\n"
        f"  Begin SubModelPart Outer\n   Begin SubModelPartConditions\n{lines}   End SubModelPartConditions\n"
        "  End SubModelPart\nEnd SubModelPart\n"
    )  # fmt: skip


def solid(path: Path) -> None:
    """Numbers from 11 in two blocks of nodes, properties, ends of lines of Windows, data, and the old kind of parts."""
    points, tets = shapes.block()
    half = len(points) // 2
    skin, marks = surface(tets), material(points, tets)
    text = (
        HEAD.replace("Begin Properties 1", TABLE)
        + nodes(points[:half], 11) + cells("Elements", "SmallDisplacementElement3D4N", tets + 10, marks.tolist(), 5)
        + nodes(points[half:], 11 + half) + cells("Conditions", "SurfaceCondition3D3N", skin + 10, [1] * len(skin))
        + "Begin NodalData DISPLACEMENT_X\n11 1 0.5\nEnd NodalData\n"
        "Begin Mesh 1\n Begin MeshNodes\n 11 12\n End MeshNodes\n"
        " Begin MeshElements\n 5\n 6\n End MeshElements\nEnd Mesh\n"
    )  # fmt: skip
    path.write_bytes(text.replace("\n", "\r\n").encode())


def geometries(path: Path) -> None:
    """Only geometries, all rows in a line."""
    points, tets = shapes.block()
    rows = "  ".join(f"{i} {' '.join(map(str, row))}" for i, row in enumerate((tets + 1).tolist(), 1))
    path.write_text(f"{nodes(points)}Begin Geometries Tetrahedra3D4\n{rows}\nEnd Geometries\n")


FILES: dict[str, Callable[[Path], None]] = {
    "plane.mdpa": plane, "solid.mdpa": solid, "geometries.mdpa": geometries,
}  # fmt: skip


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3) of all blocks of nodes, and all other words."""
    text = re.sub(r"(?s)//[^\n]*|/\*.*?\*/", " ", path.read_bytes().decode())
    pieces = re.split(r"(Begin Nodes|End Nodes)", text)
    points: list[list[str]] = []
    rest: list[str] = []
    for i, piece in enumerate(pieces):
        words = piece.split()
        if i % 4 == 2:
            points += [words[k + 1 : k + 4] for k in range(0, len(words), 4)]
            words = words[::4]
        rest += words
    return np.array(points, dtype=float), {"words": rest}
