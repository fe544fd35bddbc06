"""Blocks of VTK as it writes them, .vtm and files beside it, and its own reader of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_medit import surface
from files_pvtu import grid, slabs
from files_vtp import polydata
from numpy.typing import NDArray
from shapes import block


def parts() -> dict[str, Any]:
    """The two halves of a block of tetrahedra, and triangles of their boundary."""
    points, cells = block()
    piece, skin = slabs(points, cells, 2), surface(cells)
    found: dict[str, Any] = {}
    for name, rows in (("left", cells[piece == 0]), ("right", cells[piece == 1])):
        used = np.unique(rows)
        found[name] = grid(points[used], np.searchsorted(used, rows), {}, {"MaterialIDs": np.full(len(rows), 5)})
    used = np.unique(skin)
    found["walls"] = polydata(points[used], np.searchsorted(used, skin).tolist())
    return found


def by_vtk(path: Path, blocks: Mapping[str, Any] | None = None) -> Path:
    """The last block within another."""
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    blocks = parts() if blocks is None else blocks
    top, inner = model.vtkMultiBlockDataSet(), model.vtkMultiBlockDataSet()
    for i, (name, one) in enumerate(blocks.items()):
        into, at = (inner, 0) if i == len(blocks) - 1 else (top, i)
        into.SetBlock(at, one)
        into.GetMetaData(at).Set(model.vtkCompositeDataSet.NAME(), name)
    top.SetBlock(len(blocks) - 1, inner)
    top.GetMetaData(len(blocks) - 1).Set(model.vtkCompositeDataSet.NAME(), "boundary")
    writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLMultiBlockDataWriter()
    writer.SetInputData(top)
    writer.SetFileName(str(path))
    writer.SetDataModeToAscii()
    assert writer.Write()
    return path


def series(path: Path, *files: tuple[str, str]) -> Path:
    """Write a .pvd of steps and files."""
    listed = "".join(f'<DataSet timestep="{step}" part="{i}" file="{name}"/>' for i, (step, name) in enumerate(files))
    path.write_text(f'<VTKFile type="Collection" version="0.1"><Collection>{listed}</Collection></VTKFile>')
    return path


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """What VTK reads of all blocks together."""
    vtk_to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLMultiBlockDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    points: list[NDArray[Any]] = []
    found: dict[str, Any] = {}

    def visit(one: Any, name: str) -> None:
        if hasattr(one, "GetNumberOfBlocks"):
            for i in range(one.GetNumberOfBlocks()):
                visit(one.GetBlock(i), f"{name}/{one.GetMetaData(i).Get(one.NAME())}")
            return
        points.append(vtk_to_numpy(one.GetPoints().GetData()))
        cells = []
        for i in range(one.GetNumberOfCells()):
            ids = one.GetCell(i).GetPointIds()
            cells.append([ids.GetId(k) for k in range(ids.GetNumberOfIds())])
        found[name] = cells
        for what, arrays in (("point", one.GetPointData()), ("cell", one.GetCellData())):
            for i in range(arrays.GetNumberOfArrays()):
                found[f"{name} {what} {arrays.GetArray(i).GetName()}"] = vtk_to_numpy(arrays.GetArray(i))

    visit(reader.GetOutput(), "")
    return np.concatenate(points), found
