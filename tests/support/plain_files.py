"""A mesh as a plain file of each format that meshfix reads, with all digits that the format can hold."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from importlib.util import find_spec
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
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):  # it warns of formats that may change
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


NASTRAN = {
    "triangle": "CTRIA3", "quad": "CQUAD4", "tetra": "CTETRA", "pyramid": "CPYRAM", "wedge": "CPENTA",
    "hexahedron": "CHEXA",
}  # fmt: skip


def nastran(points: NDArray[np.floating], cells: Cells, path: Path) -> None:
    """Write the free format, in which the seventh corner begins a second line."""
    lines = ["BEGIN BULK", *[f"GRID,{i},,{','.join(map(repr, row))}" for i, row in enumerate(points.tolist(), 1)]]
    rows = [(name, row) for name, some in cells.items() for row in (some + 1).tolist()]
    for number, (name, row) in enumerate(rows, 1):
        corners = ",".join(map(str, row[:6])) + "".join([",+\n+,", ",".join(map(str, row[6:]))] if row[6:] else "")
        lines.append(f"{NASTRAN[name]},{number},1,{corners}")
    path.write_text("\n".join([*lines, "ENDDATA", ""]))


def plane(form: str, **options: Any) -> Callable[[NDArray[np.floating], Cells, Path], None]:
    """Write plane meshes with two coordinates: there is no other way to say that they are plane."""

    def write(points: NDArray[np.floating], cells: Cells, path: Path) -> None:
        flat = set(cells) <= {"triangle", "quad"}
        by_meshio(form, points[:, :2] if flat else points, cells, path, **options)

    return write


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
    # Those that meshio reads for meshfix.
    "through.avs": of_meshio("avsucd"),
    "through.bdf": nastran,
    "through.f3grid": of_meshio("flac3d"),
    "through.lb8.ugrid": of_meshio("ugrid"),
    "through.mdpa": of_meshio("mdpa"),
    "through.node": of_meshio("tetgen"),
    "through.off": of_meshio("off"),
    "through.post": of_meshio("permas"),
    "through.su2": plane("su2"),
    "through.vol": of_meshio("netgen"),
    "through.xdmf": of_meshio("xdmf", data_format="XML"),
    "through.xml": plane("dolfin-xml"),
}
if find_spec("h5py"):
    WRITERS |= {f"through.{form}": of_meshio(form) for form in ("cgns", "h5m", "hmf", "med")}
if find_spec("netCDF4"):
    WRITERS["through.e"] = of_meshio("exodus")
SINGLE = ("single.vtk", "single.vtu", "binary.stl")  # the coordinates are rounded
SURFACES = (".obj", ".ply", ".stl", ".off")  # what holds no tetrahedra
SOLIDS = (".cgns", ".f3grid", ".node")  # what holds no plane mesh
# What holds no other cells, or is written so by meshio.
SIMPLICES = (".stl", ".ply", ".cgns", ".h5m", ".mdpa", ".node", ".off", ".xml", "gmsh41.msh", "gmsh41_binary.msh")


def writers(dimension: int, mixed: bool) -> list[str]:
    """Return the names of files that can hold a mesh exactly, with cells of other types beside simplices if `mixed`."""
    out = (*SINGLE, *(SURFACES if dimension == 3 else SOLIDS), *(SIMPLICES if mixed else ()))
    return [name for name in WRITERS if not name.endswith(out)]
