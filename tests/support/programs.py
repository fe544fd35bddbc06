"""Programs that people use, for the tests to write and read files with; a test is skipped where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapes

TILTED = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a rotation


@contextmanager
def gmsh_session(**options: float) -> Iterator[Any]:
    """gmsh without a word, and with some options of `Mesh`."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # not installed, or without the libraries of a desktop
        pytest.skip(f"gmsh cannot be used: {error}")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        for name, value in options.items():
            gmsh.option.setNumber(f"Mesh.{name}", value)
        yield gmsh
    finally:
        gmsh.finalize()


def vtk_writes_surface(path: Path, module: str, writer: str, binary: bool | None = None) -> None:
    """Let a writer of VTK write a skew plane in single precision."""
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, cells = shapes.plate()
    mesh, vtk_points, triangles = vtkPolyData(), vtkPoints(), vtkCellArray()
    vtk_points.SetData(numpy_to_vtk((points @ TILTED).astype(np.float32), deep=True))
    for cell in cells.tolist():
        triangles.InsertNextCell(3, cell)
    mesh.SetPoints(vtk_points)
    mesh.SetPolys(triangles)
    output = getattr(pytest.importorskip(f"vtkmodules.{module}"), writer)()
    output.SetFileName(str(path))
    output.SetInputData(mesh)
    if binary is not None:
        (output.SetFileTypeToBinary if binary else output.SetFileTypeToASCII)()
    output.Write()
