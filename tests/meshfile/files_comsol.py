"""Files of Comsol as it writes them, and older ones, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, rows, surface
from numpy.typing import NDArray

NAMES = {1: "vtx", 2: "edg", 3: "tri", 4: "tet"}
Cells = Sequence[tuple[str, NDArray[np.int64], NDArray[np.int64] | None]]


def mesh(points: NDArray[np.float64], cells: Cells, version: int = 4, first: int = 0) -> str:
    """An object of a mesh: the points of cells are numbered from `first`, and each run may have entities."""
    head = f"0 0 1 \n4 Mesh # class\n{version} # version\n{points.shape[1]} # sdim\n"
    text = (
        head
        + f"{len(points)} # number of mesh vertices\n{first} # lowest mesh vertex index\n\n# Mesh vertex coordinates\n"
    )
    text += rows([f"{x:.6f}" for x in p] for p in points) + f"\n{len(cells)} # number of element types\n\n"
    for i, (name, some, entities) in enumerate(cells):
        text += f"# Type #{i}\n\n{len(name)} {name} # type name\n\n\n{some.shape[1]} # number of vertices per element\n"
        text += f"{len(some)} # number of elements\n# Elements\n{rows(some + first)}\n"
        if version < 4:
            text += "1 # number of parameter values per element\n2 # number of parameters\n# Parameters\n0.5\n0.25\n"
        listed = [] if entities is None else entities[:, None].tolist()
        text += f"{len(listed)} # number of geometric entity indices\n# Geometric entity indices\n{rows(listed)}\n"
        if version < 4:
            text += "1 # number of up/down pairs\n# Up/down\n0 1\n"
    return text


def selection(name: str, dimension: int, entities: Sequence[int]) -> str:
    listed = rows([one] for one in entities)
    return f"0 0 1 \n9 Selection # class\n0 # Version\n{len(name)} {name} # Label\n5 mesh1 # Geometry/mesh tag\n" + (
        f"{dimension} # Dimension\n{len(entities)} # Number of entities\n# Entities\n{listed}"
    )


def file(*objects: str) -> str:
    tags = "".join(f"5 mesh{i} \n" for i in range(len(objects)))
    head = "# Created by COMSOL Multiphysics.\n\n# Major & minor version\n0 1 \n"
    return (
        head
        + f"{len(objects)} # number of tags\n# Tags\n{tags}{len(objects)} # number of types\n# Types\n"
        + (
            "3 obj \n" * len(objects)
            + "\n"
            + "".join(f"# --------- Object {i} ----------\n\n{one}\n" for i, one in enumerate(objects))
        )
    )


def solid(path: Path) -> None:
    """With selections of a domain and of boundaries, and a label with blanks and a # in it."""
    points, cells = shapes.block()
    skin = surface(cells)
    parts: Cells = [("tri", skin, np.arange(len(skin)) % 3), ("tet", cells, material(points, cells))]
    path.write_text(file(mesh(points, parts), selection("a # core", 3, [2]), selection("wall", 2, [0, 2])))


def plane(path: Path) -> None:
    """Of an older version, numbered from 1, with ends of lines of Windows."""
    points, cells = shapes.plate()
    text = file(
        mesh(points[:, :2], [("tri", cells, np.ones(len(cells), dtype=np.int64)), ("edg", surface(cells), None)], 2, 1)
    )
    path.write_bytes(text.replace("\n", "\r\n").encode())


FILES: dict[str, Callable[[Path], None]] = {"solid.mphtxt": solid, "plane.mphtxt": plane}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other lines."""
    lines = path.read_text().splitlines()
    at = lines.index("# Mesh vertex coordinates") + 1
    count = int(lines[at - 4].split()[0])
    points = np.array([line.split() for line in lines[at : at + count]], dtype=float)
    rest = {"rest": lines[:at] + lines[at + count :]}
    return np.column_stack([points, np.zeros((count, 3 - points.shape[1]))]), rest
