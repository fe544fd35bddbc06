"""VTK's XML files as VTK, ParaView and meshio write them, and VTK's own reader of them."""

from __future__ import annotations

import base64
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shapes import block, plate

TETRA, TRIANGLE = 10, 5


def filled(points: NDArray[Any], cells: NDArray[Any]) -> Any:
    """A grid of VTK with a boundary triangle, a vertex, and data of all kinds."""
    core = pytest.importorskip("vtkmodules.vtkCommonCore")
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    numpy_to_vtk = pytest.importorskip("vtkmodules.util.numpy_support").numpy_to_vtk
    grid = model.vtkUnstructuredGrid()
    places = core.vtkPoints()
    places.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(places)
    kind = TRIANGLE if cells.shape[1] == 3 else TETRA
    grid.InsertNextCell(1, 1, [0])
    for cell in cells.tolist():
        grid.InsertNextCell(kind, len(cell), cell)
    grid.InsertNextCell(3, 2, cells[0, :2].tolist())

    def add(data: Any, name: str, values: NDArray[Any]) -> None:
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        data.AddArray(array)

    n, m = len(points), len(cells) + 2
    add(grid.GetPointData(), "temperature", np.linspace(273.15, 300, n))
    add(grid.GetPointData(), "velocity", np.arange(3 * n, dtype=np.float32).reshape(n, 3) / 7)
    add(grid.GetPointData(), "clamped", (np.arange(n) < 2).astype(np.uint8))
    add(grid.GetCellData(), "MaterialIDs", np.full(m, -3, dtype=np.int32))
    add(grid.GetFieldData(), "TimeValue", np.array([0.1]))
    grid.GetPointData().SetActiveScalars("temperature")
    note = core.vtkStringArray()
    note.SetName("author")
    note.InsertNextValue("Lee & <sons>")
    grid.GetFieldData().AddArray(note)
    return grid


def by_vtk(
    path: Path,
    mode: str,
    compressor: str = "None",
    *,
    shape: Callable[[], Any] = block,
    dtype: str = "f8",
    encoded: bool = True,
    settings: tuple[str, ...] = (),
) -> None:
    """Write by VTK; its settings by the names of their methods."""
    if compressor == "LZ4":
        pytest.importorskip("lz4.block")
    points, cells = shape()
    writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLUnstructuredGridWriter()
    writer.SetInputData(filled(points.astype(dtype), cells))
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.SetEncodeAppendedData(encoded)
    writer.SetBlockSize(1024)
    for setting in ("SetHeaderTypeToUInt32", *settings):
        getattr(writer, setting)()
    assert writer.Write()


def with_comments(
    path: Path, maker: Callable[[Path], None], newline: bytes = b"\n", mark: bytes = b"<UnstructuredGrid>"
) -> None:
    """Some programs sign what they write."""
    maker(path)
    data = path.read_bytes().replace(mark, b"<!-- made by\n     hand -->\n  " + mark, 1)
    path.write_bytes(data.replace(b"\n", newline))


def by_meshio(path: Path) -> None:
    import meshio

    points, cells = plate()
    runs = [("line", cells[:1, :2]), ("triangle", cells)]
    mesh = meshio.Mesh(points, runs, {"s": points[:, 0].copy()}, {"gmsh:physical": [[7], np.full(len(cells), 1)]})
    meshio.write(path, mesh, file_format="vtu")


def in_pieces(path: Path) -> None:
    """One piece as text, an empty one, and one in base64; attributes in any order and in either quotes."""
    points, cells = plate()
    text = "\n".join(f"  {x:.6f}\t{y:.6f}   0." for x, y, _ in points)
    far = points + np.array([100.0, 0.0, 0.0])
    packed = base64.b64encode(struct.pack("<I", far.nbytes) + far.tobytes()).decode()

    def piece(places: str, corners: NDArray[Any], s: float) -> str:
        ends = " ".join(str(3 * i + 3) for i in range(len(corners)))
        return (
            f"<Piece NumberOfCells='{len(corners)}' NumberOfPoints='{len(points)}'>\n<Points>\n{places}\n</Points>\n"
            "<Cells>\n<DataArray Name='types' type='UInt8' format='ascii'>" + "5 " * len(corners) + "</DataArray>\n"
            f"<DataArray type='Int32' Name='offsets' format='ascii'>{ends}</DataArray>\n"
            "<DataArray type='Int32' Name='connectivity' format='ascii'>\n"
            + "\n".join(" ".join(map(str, row)) for row in corners.tolist())
            + '\n</DataArray>\n</Cells>\n<PointData Scalars="s">\n'
            "<DataArray type='Float64' Name='s' format='ascii'>\n"
            + " ".join([str(s)] * len(points))
            + "</DataArray>\n</PointData>\n</Piece>\n"
        )

    kind = "NumberOfComponents = '3' type=\"Float64\""
    empty = (
        "<Piece NumberOfPoints='0' NumberOfCells='0'><Points><DataArray type='Float32' NumberOfComponents='3' "
        "format='ascii'></DataArray></Points><Cells><DataArray type='Int32' Name='connectivity' format='ascii'/>"
        "<DataArray type='Int32' Name='offsets' format='ascii'/><DataArray type='UInt8' Name='types' format='ascii'/>"
        "</Cells></Piece>\n"
    )
    path.write_text(
        "<?xml version='1.0' encoding='UTF-8'?>\n<!-- solver 7 -->\n"
        "<VTKFile version='0.1' type='UnstructuredGrid' byte_order='LittleEndian'>\n<UnstructuredGrid>\n"
        + piece(f"<DataArray {kind} format='ascii'>\n{text}\n</DataArray>", cells, 1.5)
        + empty
        + piece(f"<DataArray format='binary' {kind}>\n    {packed}\n  </DataArray>", cells, 2.5)
        + "</UnstructuredGrid>\n</VTKFile>\n"
    )


FILES: dict[str, Callable[[Path], None]] = {
    "ascii_double.vtu": partial(with_comments, maker=partial(by_vtk, mode="Ascii")),
    "ascii_float_windows.vtu": partial(
        with_comments, maker=partial(by_vtk, mode="Ascii", shape=plate, dtype="f4"), newline=b"\r\n"
    ),
    "inline_double.vtu": partial(by_vtk, mode="Binary", settings=("SetHeaderTypeToUInt64",)),
    "inline_zlib_float.vtu": partial(
        with_comments, maker=partial(by_vtk, mode="Binary", compressor="ZLib", shape=plate, dtype="f4")
    ),
    "raw_double.vtu": partial(with_comments, maker=partial(by_vtk, mode="Appended", encoded=False)),
    "raw_big_endian_float.vtu": partial(
        by_vtk, mode="Appended", dtype="f4", encoded=False, settings=("SetByteOrderToBigEndian",)
    ),
    "raw_lz4.vtu": partial(
        by_vtk, mode="Appended", compressor="LZ4", encoded=False, settings=("SetHeaderTypeToUInt64",)
    ),
    "raw_zlib_float.vtu": partial(by_vtk, mode="Appended", compressor="ZLib", dtype="f4", encoded=False),
    "appended_float.vtu": partial(by_vtk, mode="Appended", dtype="f4"),
    "appended_lzma.vtu": partial(by_vtk, mode="Appended", compressor="LZMA", settings=("SetByteOrderToBigEndian",)),
    "meshio.vtu": by_meshio,
    "pieces.vtu": in_pieces,
}
ENCODED = {name for name in FILES if not name.startswith(("ascii", "raw_double", "raw_big"))}


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """What VTK reads: the points; types, cells and all arrays with their names."""
    vtk_to_numpy = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    grid = reader.GetOutput()
    cells = grid.GetCells()
    found: dict[str, Any] = {
        "types": [grid.GetCellType(i) for i in range(grid.GetNumberOfCells())],
        "connectivity": vtk_to_numpy(cells.GetConnectivityArray()),
        "offsets": vtk_to_numpy(cells.GetOffsetsArray()),
    }
    for what, data in (("point", grid.GetPointData()), ("cell", grid.GetCellData()), ("field", grid.GetFieldData())):
        for i in range(data.GetNumberOfArrays()):
            array = data.GetAbstractArray(i)
            if array.IsNumeric():
                found[f"{what} {array.GetName()}"] = vtk_to_numpy(array)
            else:
                found[f"{what} {array.GetName()}"] = [array.GetValue(k) for k in range(array.GetNumberOfValues())]
    scalars = grid.GetPointData().GetScalars()
    found["active"] = scalars.GetName() if scalars else None
    return vtk_to_numpy(grid.GetPoints().GetData()), found
