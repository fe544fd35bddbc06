"""Polydata in several files as VTK writes them: .pvtp and pieces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_pvtu import slabs
from files_vtp import polydata
from numpy.typing import NDArray
from shapes import plate


def split(path: Path, count: int = 3, dtype: str = "f8") -> Path:
    """Write triangles in pieces, with lines along a side of each."""
    points, cells = plate()
    piece = slabs(points, cells, count)
    names = []
    for i in range(count):
        own = cells[piece == i]
        used = np.unique(own)
        rows = np.searchsorted(used, own)
        writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLPolyDataWriter()
        writer.SetInputData(polydata(points[used].astype(dtype), rows.tolist()))
        names.append(f"{path.stem}_{i}.vtp")
        writer.SetFileName(str(path.parent / names[-1]))
        writer.SetDataModeToAscii()
        assert writer.Write()
    kind = {"f4": "Float32", "f8": "Float64"}[dtype]
    pieces = "".join(f'    <Piece Source="{name}"/>\n' for name in names)
    path.write_text(
        '<?xml version="1.0"?>\n<VTKFile type="PPolyData" version="0.1">\n  <PPolyData GhostLevel="0">\n'
        '    <PPointData>\n      <PDataArray type="Float64" Name="height"/>\n    </PPointData>\n'
        '    <PCellData>\n      <PDataArray type="Int64" Name="number"/>\n    </PCellData>\n    <PPoints>\n'
        f'      <PDataArray type="{kind}" Name="Points" NumberOfComponents="3"/>\n    </PPoints>\n'
        f"{pieces}  </PPolyData>\n</VTKFile>\n"
    )
    return path


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """What VTK reads in all pieces together."""
    vtk_to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLPPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    data = reader.GetOutput()
    found: dict[str, Any] = {"polys": vtk_to_numpy(data.GetPolys().GetConnectivityArray())}
    for what, arrays in (("point", data.GetPointData()), ("cell", data.GetCellData())):
        for i in range(arrays.GetNumberOfArrays()):
            found[f"{what} {arrays.GetArray(i).GetName()}"] = vtk_to_numpy(arrays.GetArray(i))
    return vtk_to_numpy(data.GetPoints().GetData()), found
