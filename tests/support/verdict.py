"""Verdict's values of the metrics, as VTK computes them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import Element

KINDS = {"triangle": "Triangle", "quad": "Quad", "tetra": "Tet", "pyramid": "Pyramid", "wedge": "Wedge",
         "hexahedron": "Hex"}  # fmt: skip
NAMES = {
    "min_angle": "MinAngle",
    "aspect_ratio": "AspectRatio",
    "scaled_jacobian": "ScaledJacobian",
    "shape": "Shape",
    "mean_ratio": "Shape",
    "radius_ratio": "RadiusRatio",
}


def vtk_quality(name: str, element: Element, nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k,) of a metric of elements of a type, whose nodes (k, nodes, d) are there."""
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkUnstructuredGrid
    from vtkmodules.vtkFiltersVerdict import vtkMeshQuality

    points, cells = vtkPoints(), vtkCellArray()
    points.SetDataTypeToDouble()
    for p in nodes.reshape(-1, nodes.shape[2]).tolist():
        points.InsertNextPoint(*p, *[0.0] * (3 - len(p)))
    for row in np.arange(nodes.shape[0] * nodes.shape[1]).reshape(nodes.shape[:2]).tolist():
        cells.InsertNextCell(len(row), row)
    grid = vtkUnstructuredGrid()
    grid.SetPoints(points)
    grid.SetCells(element.vtk, cells)
    check = vtkMeshQuality()
    check.SetInputData(grid)
    getattr(check, f"Set{KINDS[element.key]}QualityMeasureTo{NAMES[name]}")()
    check.Update()
    quality: NDArray[np.float64] = vtk_to_numpy(check.GetOutput().GetCellData().GetArray("Quality"))
    return quality
