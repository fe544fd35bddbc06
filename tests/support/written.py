"""Meshes of any elements in files of other programs: of gmsh, of VTK, of meshio."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from building import Blocks, Points
from programs import gmsh_session

from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.gmsh.cells import TYPES, order_of
from meshfix_cli.meshfile.vtk.cells import number_of

Made = Callable[[Path, Points, Blocks], None]


def by_gmsh(path: Path, points: Points, cells: Blocks, options: dict[str, float] | None = None) -> None:
    with gmsh_session(SaveAll=1, **options or {}) as gmsh:
        dimension, numbers = dimension_of(cells[0][0]), {key: number for number, (key, _) in TYPES.items()}
        gmsh.model.addDiscreteEntity(dimension, 1)
        gmsh.model.mesh.addNodes(dimension, 1, np.arange(len(points)) + 1, points.ravel())
        for key, rows in cells:
            order = np.argsort(order_of(key) or range(rows.shape[1]))
            gmsh.model.mesh.addElementsByType(1, numbers[key], [], (rows[:, order] + 1).ravel())
        gmsh.write(str(path))


def by_meshio(path: Path, points: Points, cells: Blocks) -> None:
    """gmsh leaves prisms and pyramids out of MEDIT's files."""
    meshio.Mesh(points, cells).write(path)


def grid_of(points: Points, cells: Blocks) -> Any:
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    core = pytest.importorskip("vtkmodules.vtkCommonCore")
    grid, places = model.vtkUnstructuredGrid(), core.vtkPoints()
    places.SetDataType(11)
    for point in points.tolist():
        places.InsertNextPoint(point)
    grid.SetPoints(places)
    for key, rows in cells:
        for row in rows.tolist():
            grid.InsertNextCell(number_of(key), len(row), row)
    return grid


def by_vtk(path: Path, points: Points, cells: Blocks, binary: bool = False) -> None:
    writer: Any
    if path.suffix == ".vtu":
        writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLUnstructuredGridWriter()
        writer.SetDataMode(2 if binary else 0)
    else:
        writer = pytest.importorskip("vtkmodules.vtkIOLegacy").vtkUnstructuredGridWriter()
        writer.SetFileType(2 if binary else 1)
    writer.SetInputData(grid_of(points, cells))
    writer.SetFileName(str(path))
    assert writer.Write()


def surface_by_vtk(path: Path, points: Points, cells: Blocks) -> None:
    filters = pytest.importorskip("vtkmodules.vtkFiltersGeometry")
    surface = filters.vtkGeometryFilter()
    surface.SetInputData(grid_of(points, cells))
    if path.suffix == ".obj":
        writer = pytest.importorskip("vtkmodules.vtkIOGeometry").vtkOBJWriter()
    else:
        writer = pytest.importorskip("vtkmodules.vtkIOPLY").vtkPLYWriter()
    writer.SetInputConnection(surface.GetOutputPort())
    writer.SetFileName(str(path))
    writer.Write()


TEXT_2: dict[str, float] = {"MshFileVersion": 2.2, "Binary": 0}
TEXT_4: dict[str, float] = {"MshFileVersion": 4.1, "Binary": 0}
SOLIDS: dict[str, Made] = {
    "text_2.msh": partial(by_gmsh, options=TEXT_2),
    "binary_2.msh": partial(by_gmsh, options={**TEXT_2, "Binary": 1}),
    "text_4.msh": partial(by_gmsh, options=TEXT_4),
    "binary_4.msh": partial(by_gmsh, options={**TEXT_4, "Binary": 1}),
    "gmsh.inp": by_gmsh,
    "meshio.mesh": by_meshio,
    "text.vtk": by_vtk,
    "binary.vtk": partial(by_vtk, binary=True),
    "text.vtu": by_vtk,
    "binary.vtu": partial(by_vtk, binary=True),
}
