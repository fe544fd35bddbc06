"""Meshes in several files as VTK writes them: .pvtu and pieces, with or without global ids and ghost cells."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_vtu import TETRA, TRIANGLE
from numpy.typing import NDArray
from shapes import block

from meshfix_cli.mesh.elements import ELEMENTS

KINDS = {3: TRIANGLE, 4: TETRA, 10: ELEMENTS["tetra10"].vtk}


def slabs(points: NDArray[Any], cells: NDArray[Any], count: int) -> NDArray[np.int64]:
    """The piece (m,) of each cell: slabs along x that have the same number of cells."""
    order = np.argsort(points[cells].mean(axis=1)[:, 0], kind="stable")
    piece = np.empty(len(cells), dtype=np.int64)
    piece[order] = np.arange(len(cells)) * count // len(cells)
    return piece


def grid(points: NDArray[Any], cells: NDArray[Any], of_points: dict[str, Any], of_cells: dict[str, Any]) -> Any:
    """A grid of VTK."""
    core = pytest.importorskip("vtkmodules.vtkCommonCore")
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    numpy_to_vtk = pytest.importorskip("vtkmodules.util.numpy_support").numpy_to_vtk
    result, places = model.vtkUnstructuredGrid(), core.vtkPoints()
    places.SetData(numpy_to_vtk(points, deep=True))
    result.SetPoints(places)
    for cell in cells.tolist():
        result.InsertNextCell(KINDS[len(cell)], len(cell), cell)
    for data, arrays in ((result.GetPointData(), of_points), (result.GetCellData(), of_cells)):
        for name, values in arrays.items():
            array = numpy_to_vtk(np.asarray(values), deep=True)
            array.SetName(name)
            data.AddArray(array)
            if name == "ids":
                data.SetGlobalIds(array)
    return result


def save(path: Path, result: Any, mode: str = "Appended", compressor: str = "None") -> None:
    """Write a grid by VTK; "Raw" is appended without base64."""
    writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLUnstructuredGridWriter()
    writer.SetInputData(result)
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode.replace('Raw', 'Appended')}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.SetEncodeAppendedData(mode != "Raw")
    assert writer.Write()


def index(path: Path, names: Sequence[str], kind: str = "Float64") -> Path:
    """Write a .pvtu by hand, with a comment; it declares the arrays of the first piece that has some."""
    heads = [one.read_text("latin-1") for one in (path.parent / name for name in names) if one.exists()]
    sections = ""
    for section in ("PointData", "CellData"):
        found = [re.search(rf"<({section}[^>]*)>(.*?)</{section}>", head, re.DOTALL) for head in heads]
        declared = next((match for match in found if match and "<DataArray" in match[2]), None)
        if declared:
            arrays = re.findall(r'<DataArray (type="\w+")(?: IdType="1")? (Name="\w+")', declared[2])
            inside = "".join(f"      <PDataArray {' '.join(array)}/>\n" for array in arrays)
            sections += f"    <P{declared[1]}>\n{inside}    </P{section}>\n"
    pieces = "".join(f"    <Piece Source='{name}'/>\n" for name in names)
    path.write_text(
        '<?xml version="1.0"?>\n<!-- solver 7 -->\n<VTKFile type="PUnstructuredGrid" version="0.1">\n'
        f'  <PUnstructuredGrid GhostLevel="0">\n{sections}    <PPoints>\n'
        f'      <PDataArray type="{kind}" Name="Points" NumberOfComponents="3"/>\n    </PPoints>\n'
        f"{pieces}  </PUnstructuredGrid>\n</VTKFile>\n"
    )
    return path


def split(
    path: Path,
    points: NDArray[Any],
    cells: NDArray[Any],
    piece: NDArray[np.int64],
    *,
    ids: bool = False,
    ghosts: bool = False,
    mode: str = "Appended",
    compressor: str = "None",
    names: str = "{stem}_{i}.vtu",
) -> Path:
    """Write a mesh in pieces; those that have no cell are empty. Points keep their order."""
    written = []
    for i in range(int(piece.max()) + 1):
        own = piece == i
        near = own
        if ghosts and own.any():
            near = own | np.isin(cells, cells[own]).any(axis=1)
        rows = np.flatnonzero(near)
        used = np.unique(cells[rows])
        of_points: dict[str, Any] = {"height": points[used, 0].copy()} if len(rows) else {}
        if ids and len(rows):
            of_points["ids"] = 10 * used + 7
        of_cells: dict[str, Any] = {"origin": rows} if len(rows) else {}
        if ghosts and len(rows):
            of_cells["vtkGhostType"] = (~own[rows]).astype(np.uint8)
        here = path.parent / names.format(stem=path.stem, i=i)
        here.parent.mkdir(exist_ok=True)
        save(here, grid(points[used], np.searchsorted(used, cells[rows]), of_points, of_cells), mode, compressor)
        written.append(names.format(stem=path.stem, i=i))
    return index(path, written, {4: "Float32", 8: "Float64"}[points.dtype.itemsize])


def by_vtk(path: Path) -> Path:
    """Let VTK itself cut a mesh, number its points, and add ghost cells."""
    parallel = pytest.importorskip("vtkmodules.vtkFiltersParallelDIY2")
    points, cells = block()
    cutter = parallel.vtkRedistributeDataSetFilter()
    cutter.SetInputData(grid(points, cells, {}, {}))
    cutter.SetNumberOfPartitions(4)
    cutter.PreservePartitionsInOutputOn()
    numbers, ghosts = parallel.vtkGenerateGlobalIds(), parallel.vtkGhostCellsGenerator()
    numbers.SetInputConnection(cutter.GetOutputPort())
    ghosts.SetInputConnection(numbers.GetOutputPort())
    ghosts.BuildIfRequiredOff()
    ghosts.SetNumberOfGhostLayers(1)
    ghosts.Update()
    result = ghosts.GetOutputDataObject(0)
    names = [f"{path.stem}_{i}.vtu" for i in range(result.GetNumberOfPartitions())]
    for i, name in enumerate(names):
        save(path.parent / name, result.GetPartition(i), "Ascii")
    return index(path, names)


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """What VTK reads in all pieces together: the points, and the cells and all arrays with their names."""
    vtk_to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLPUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    result = reader.GetOutput()
    found: dict[str, Any] = {"connectivity": vtk_to_numpy(result.GetCells().GetConnectivityArray())}
    for what, data in (("point", result.GetPointData()), ("cell", result.GetCellData())):
        for i in range(data.GetNumberOfArrays()):
            found[f"{what} {data.GetArray(i).GetName()}"] = vtk_to_numpy(data.GetArray(i))
    return vtk_to_numpy(result.GetPoints().GetData()), found
