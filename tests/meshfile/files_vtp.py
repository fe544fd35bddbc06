"""VTK's XML files of polydata as VTK writes them, and VTK's own reader of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_vtu import with_comments
from numpy.typing import NDArray
from shapes import plate

Rows = Sequence[Sequence[int]]


def cell_array(rows: Rows) -> Any:
    cells = pytest.importorskip("vtkmodules.vtkCommonDataModel").vtkCellArray()
    for row in rows:
        cells.InsertNextCell(len(row), row)
    return cells


def polydata(points: NDArray[Any], polys: Rows, verts: Rows = (), lines: Rows = (), strips: Rows = ()) -> Any:
    """Polydata with data of points and cells; the latter tell the order in which VTK counts."""
    core = pytest.importorskip("vtkmodules.vtkCommonCore")
    numpy_to_vtk = pytest.importorskip("vtkmodules.util.numpy_support").numpy_to_vtk
    data = pytest.importorskip("vtkmodules.vtkCommonDataModel").vtkPolyData()
    places = core.vtkPoints()
    places.SetData(numpy_to_vtk(points, deep=True))
    data.SetPoints(places)
    data.SetVerts(cell_array(verts))
    data.SetLines(cell_array(lines))
    data.SetPolys(cell_array(polys))
    data.SetStrips(cell_array(strips))

    def add(into: Any, name: str, values: NDArray[Any]) -> None:
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        into.AddArray(array)

    add(data.GetPointData(), "height", points[:, 2].copy())
    add(data.GetCellData(), "number", np.arange(data.GetNumberOfCells()))
    return data


def sheet(dtype: str, strips: bool = True) -> Any:
    """Triangles, some vertices and lines of their boundary, and perhaps a strip of two triangles beside them."""
    points, cells = plate()
    n = len(points)
    beside = np.array([[9, 0, 0], [10, 0, 0], [9, 1, 0], [10, 1, 0]], dtype=float)
    lines = [cells[0, :2].tolist(), cells[1].tolist()]
    listed = [[n, n + 1, n + 2, n + 3]] if strips else []
    return polydata(np.concatenate([points, beside]).astype(dtype), cells.tolist(), [[0], [1, 2]], lines, listed)


def by_vtk(
    path: Path,
    mode: str,
    compressor: str = "None",
    *,
    dtype: str = "f8",
    encoded: bool = True,
    pieces: int = 1,
    strips: bool = True,
    settings: Sequence[str] = (),
) -> None:
    """Write by VTK; its settings by the names of their methods."""
    writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLPolyDataWriter()
    writer.SetInputData(sheet(dtype, strips))
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.SetEncodeAppendedData(encoded)
    writer.SetNumberOfPieces(pieces)
    for setting in settings:
        getattr(writer, setting)()
    assert writer.Write()


FILES: dict[str, Callable[[Path], None]] = {
    "ascii_double.vtp": partial(with_comments, maker=partial(by_vtk, mode="Ascii"), mark=b"<PolyData>"),
    "inline_zlib_float.vtp": partial(by_vtk, mode="Binary", compressor="ZLib", dtype="f4"),
    "appended.vtp": partial(by_vtk, mode="Appended"),
    "raw_big_endian_float.vtp": partial(
        by_vtk, mode="Appended", dtype="f4", encoded=False, settings=("SetByteOrderToBigEndian",)
    ),
}
ENCODED = {"inline_zlib_float.vtp", "appended.vtp"}


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """What VTK reads: the points; types, cells and all arrays with their names."""
    vtk_to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    data = reader.GetOutput()
    found: dict[str, Any] = {"types": [data.GetCellType(i) for i in range(data.GetNumberOfCells())]}
    found["cells"] = []
    for i in range(data.GetNumberOfCells()):
        ids = data.GetCell(i).GetPointIds()
        found["cells"].append([ids.GetId(k) for k in range(ids.GetNumberOfIds())])
    for what, arrays in (("point", data.GetPointData()), ("cell", data.GetCellData())):
        for i in range(arrays.GetNumberOfArrays()):
            found[f"{what} {arrays.GetArray(i).GetName()}"] = vtk_to_numpy(arrays.GetArray(i))
    return vtk_to_numpy(data.GetPoints().GetData()), found
