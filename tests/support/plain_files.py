"""A mesh as a plain file of each format that meshfix reads by itself, with all digits that the format can hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

Cells = Mapping[str, NDArray[np.int64]]
ABAQUS = {
    "triangle": "CPS3", "quad": "CPS4", "tetra": "C3D4", "pyramid": "C3D5", "wedge": "C3D6", "hexahedron": "C3D8",
}  # fmt: skip


def by_meshio(form: str, points: NDArray[np.floating], cells: Cells, path: Path, **options: Any) -> None:
    # PLY has no integers of 64 bits.
    blocks = [(name, rows.astype(np.int32)) for name, rows in cells.items()]
    # Given, they are not computed, which would divide by the area of a facet.
    data = {"facet_normals": [np.zeros((len(rows), 3)) for _, rows in blocks]} if form == "stl" else {}
    meshio.Mesh(points, blocks, cell_data=data).write(path, form, **options)


def abaqus(points: NDArray[np.floating], cells: Cells, path: Path) -> None:
    lines = ["*NODE", *[f"{i}, {', '.join(map(repr, row))}" for i, row in enumerate(points.tolist(), 1)]]
    number = 0
    for name, rows in cells.items():
        lines.append(f"*ELEMENT, TYPE={ABAQUS[name]}")
        for row in rows.tolist():
            number += 1
            lines.append(", ".join(map(str, [number, *(i + 1 for i in row)])))
    path.write_text("\n".join(lines) + "\n")


def of_meshio(form: str, **options: Any) -> Callable[[NDArray[np.floating], Cells, Path], None]:
    return lambda points, cells, path: by_meshio(form, points, cells, path, **options)


def single(form: str, **options: Any) -> Callable[[NDArray[np.floating], Cells, Path], None]:
    return lambda points, cells, path: by_meshio(form, points.astype(np.float32), cells, path, **options)


WRITERS: dict[str, Callable[[NDArray[np.floating], Cells, Path], None]] = {
    "gmsh22.msh": of_meshio("gmsh22", binary=False),
    "gmsh22_binary.msh": of_meshio("gmsh22", binary=True),
    "gmsh41.msh": of_meshio("gmsh", binary=False),
    "gmsh41_binary.msh": of_meshio("gmsh", binary=True),
    "old.vtk": of_meshio("vtk42", binary=False),
    "new.vtk": of_meshio("vtk", binary=True),
    "single.vtk": single("vtk42", binary=True),
    "binary.vtu": of_meshio("vtu", binary=True),
    "single.vtu": single("vtu", binary=True),
    "abaqus.inp": abaqus,
    "medit.mesh": of_meshio("medit"),
    "surface.obj": of_meshio("obj"),
    "text.ply": of_meshio("ply", binary=False),
    "binary.ply": of_meshio("ply", binary=True),
    "text.stl": of_meshio("stl", binary=False),
    "binary.stl": of_meshio("stl", binary=True),
}
SINGLE = ("single.vtk", "single.vtu", "binary.stl")  # the coordinates are rounded
SURFACES = ("surface.obj", "text.ply", "binary.ply", "text.stl", "binary.stl")
