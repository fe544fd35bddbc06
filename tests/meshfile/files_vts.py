"""Structured grids as VTK writes them, in XML and in legacy files, and its own readers of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray


def rows(shape: Sequence[int]) -> NDArray[np.float64]:
    """Points, the first index fastest, of which an inner one lies beyond its neighbour."""
    z, y, x = np.meshgrid(*(np.arange(n) for n in shape[::-1]), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()]).astype(float)
    inner = ((points[:, :2] == [1, 1]) | (np.array(shape[:2]) == 1)).all(axis=1) & (
        points[:, 2] == min(shape[2] - 1, 1)
    )
    points[inner] += np.where(np.array(shape) > 1, [1.25, 0.25, 0.125], 0)
    return points


def grid(shape: Sequence[int], dtype: str = "f8", first: int = 0) -> Any:
    """A grid of VTK with data of points and cells, and with indices from some number on."""
    core = pytest.importorskip("vtkmodules.vtkCommonCore")
    numpy_to_vtk = pytest.importorskip("vtkmodules.util.numpy_support").numpy_to_vtk
    data = pytest.importorskip("vtkmodules.vtkCommonDataModel").vtkStructuredGrid()
    data.SetExtent(*(end for n in shape for end in (first, first + n - 1)))
    places = core.vtkPoints()
    places.SetData(numpy_to_vtk(rows(shape).astype(dtype), deep=True))
    data.SetPoints(places)
    for into, count, name in (
        (data.GetPointData(), data.GetNumberOfPoints(), "height"),
        (data.GetCellData(), data.GetNumberOfCells(), "number"),
    ):
        array = numpy_to_vtk(np.arange(count), deep=True)
        array.SetName(name)
        into.AddArray(array)
    return data


def by_vtk(path: Path, shape: Sequence[int], mode: str = "Ascii", dtype: str = "f8", first: int = 0) -> None:
    writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLStructuredGridWriter()
    writer.SetInputData(grid(shape, dtype, first))
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode}")()
    writer.SetCompressorTypeToNone()
    writer.SetEncodeAppendedData(False)
    assert writer.Write()


def legacy(path: Path, shape: Sequence[int], binary: bool = False) -> None:
    writer = pytest.importorskip("vtkmodules.vtkIOLegacy").vtkStructuredGridWriter()
    writer.SetInputData(grid(shape))
    writer.SetFileName(str(path))
    writer.SetFileType(2 if binary else 1)
    assert writer.Write()


FILES: dict[str, Callable[[Path], None]] = {
    "solid.vts": partial(by_vtk, shape=(4, 3, 5)),
    "single.vts": partial(by_vtk, shape=(4, 3, 5), mode="Appended", dtype="f4", first=-2),
    "plane.vts": partial(by_vtk, shape=(4, 5, 1), mode="Appended"),
}


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """What VTK reads: the points; types, cells and all arrays with their names."""
    vtk_to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    if path.suffix == ".vtk":
        reader = pytest.importorskip("vtkmodules.vtkIOLegacy").vtkStructuredGridReader()
    else:
        reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLStructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    data = reader.GetOutput()
    found: dict[str, Any] = {"types": [data.GetCellType(i) for i in range(data.GetNumberOfCells())], "cells": []}
    for i in range(data.GetNumberOfCells()):
        ids = data.GetCell(i).GetPointIds()
        found["cells"].append([ids.GetId(k) for k in range(ids.GetNumberOfIds())])
    for what, arrays in (("point", data.GetPointData()), ("cell", data.GetCellData())):
        for i in range(arrays.GetNumberOfArrays()):
            found[f"{what} {arrays.GetArray(i).GetName()}"] = vtk_to_numpy(arrays.GetArray(i))
    return vtk_to_numpy(data.GetPoints().GetData()), found
