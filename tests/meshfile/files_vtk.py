"""Legacy .vtk files as VTK, ParaView, meshio and old programs write them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapes
from numpy.typing import NDArray

# Points of cells that do not move: corners of three boxes.
AWAY = np.array([[40.0 + x + 2 * i, y, z] for i in range(3) for z in (0, 1) for y in (0, 1) for x in (0, 1)])
TETRAHEDRON_OF_FACES = [4, 3, 0, 1, 2, 3, 0, 1, 4, 3, 1, 2, 4, 3, 0, 2, 4]


def _array(vtk: Any, kind: str, name: str, components: int, values: Iterable[Any]) -> Any:
    array = getattr(vtk, f"vtk{kind}Array")()
    array.SetName(name)
    array.SetNumberOfComponents(components)
    for value in values:
        array.InsertNextValue(value)
    return array


def _add_data(vtk: Any, data: Any) -> None:
    """Arrays of every kind that the writer knows, with names that it must encode."""
    random = np.random.default_rng(5)
    for attributes, n in (
        (data.GetPointData(), data.GetNumberOfPoints()),
        (data.GetCellData(), data.GetNumberOfCells()),
    ):
        numbers = random.standard_normal(9 * n).round(4).tolist()
        integers = random.integers(0, 100, n).tolist()
        attributes.SetScalars(_array(vtk, "Double", "temperature of 100%", 1, numbers[:n]))
        table = vtk.vtkLookupTable()
        table.SetNumberOfTableValues(3)
        attributes.GetScalars().SetLookupTable(table)
        attributes.SetVectors(_array(vtk, "Float", "velocity", 3, numbers[: 3 * n]))
        attributes.SetNormals(_array(vtk, "Double", "normals", 3, numbers[: 3 * n]))
        attributes.SetTCoords(_array(vtk, "Float", "uv", 2, numbers[: 2 * n]))
        attributes.SetTensors(_array(vtk, "Double", "stress", 9, numbers))
        attributes.SetGlobalIds(_array(vtk, "IdType", "global ids", 1, range(n)))
        attributes.SetPedigreeIds(_array(vtk, "String", "from", 1, ["", "a b", "c\nd", "e" * 70][: n % 5] + ["x"] * n))
        attributes.GetPedigreeIds().SetNumberOfValues(n)
        for kind in ("Bit", "UnsignedChar", "SignedChar", "Short", "UnsignedShort", "Int", "UnsignedInt", "Long"):
            top = 1 if kind == "Bit" else 100
            attributes.AddArray(_array(vtk, kind, f"of {kind}", 1, [value % (top + 1) for value in integers]))
        attributes.AddArray(_array(vtk, "UnsignedLongLong", "huge", 1, [2**62 + value for value in integers]))
        named = _array(vtk, "Double", "named", 3, numbers[: 3 * n])
        named.SetComponentName(0, "x of it")  # the second has no name
        named.SetComponentName(2, "z")
        attributes.AddArray(named)
    data.GetFieldData().AddArray(_array(vtk, "Double", "TIME", 1, [0.125]))
    data.GetFieldData().AddArray(_array(vtk, "Int", "CYCLE", 1, [7]))
    data.GetFieldData().AddArray(_array(vtk, "String", "notes", 1, ["by hand", "", "100%"]))
    variants = vtk.vtkVariantArray()
    variants.SetName("variants")
    for value in (1, "a b", 2.5):
        variants.InsertNextValue(vtk.vtkVariant(value))
    data.GetFieldData().AddArray(variants)


def _points(vtk: Any, points: NDArray[np.float64], double: bool) -> Any:
    result = vtk.vtkPoints()
    result.SetDataType(vtk.VTK_DOUBLE if double else vtk.VTK_FLOAT)
    for point in points.tolist():
        result.InsertNextPoint(point)
    result.GetData().GetRange(-1)  # which the writer then tells in METADATA
    return result


def _write(writer: Any, data: Any, path: Path, version: int, binary: bool) -> None:
    writer.SetInputData(data)
    writer.SetFileName(str(path))
    writer.SetHeader("the title: METADATA, POINTS 3 float and 100%")
    writer.SetFileVersion(version)
    writer.SetFileType(2 if binary else 1)
    assert writer.Write() == 1


def grid(path: Path, version: int, binary: bool, double: bool) -> None:
    """Tetrahedra, with other cells among them."""
    vtk = pytest.importorskip("vtkmodules.all")
    points, tetrahedra = shapes.block()
    n, half = len(points), len(tetrahedra) // 2
    data = vtk.vtkUnstructuredGrid()
    data.SetPoints(_points(vtk, np.vstack([points, AWAY]), double))
    faces = vtk.vtkIdList()
    for value in (4, *(v + n if i % 4 != 1 else v for i, v in enumerate([3, *TETRAHEDRON_OF_FACES[2:]], 1))):
        faces.InsertNextId(value)
    for tetrahedron in tetrahedra[:half].tolist():
        data.InsertNextCell(vtk.VTK_TETRA, 4, tetrahedron)
    for kind, size in ((11, 8), (3, 2), (3, 2), (4, 4), (6, 5), (1, 1), (9, 4)):
        data.InsertNextCell(kind, size, list(range(n, n + size)))
    data.InsertNextCell(vtk.VTK_WEDGE, 6, [n + 8 + v for v in (0, 1, 2, 4, 5, 6)])
    data.InsertNextCell(vtk.VTK_POLYHEDRON, faces)
    for tetrahedron in tetrahedra[half:].tolist():
        data.InsertNextCell(vtk.VTK_TETRA, 4, tetrahedron)
    _add_data(vtk, data)
    _write(vtk.vtkUnstructuredGridWriter(), data, path, version, binary)


def polydata(path: Path, version: int, binary: bool, double: bool) -> None:
    """Triangles among other polygons, with vertices, lines and strips."""
    vtk = pytest.importorskip("vtkmodules.all")
    points, triangles = shapes.plate()
    n = len(points)
    data = vtk.vtkPolyData()
    data.SetPoints(_points(vtk, np.vstack([points, AWAY * [1, 1, 0]]), double))
    others = {"Verts": [[0], [1, 2]], "Lines": [[0, 1], [1, 2, 3], [4, 5]], "Strips": [[8, 9, 10, 11], [16, 17, 18]]}
    polygons = [*triangles[:9].tolist(), [n, n + 1, n + 3, n + 2], *triangles[9:].tolist(), list(range(n, n + 5))]
    for name, cells in {**{k: [[n + v for v in c] for c in v] for k, v in others.items()}, "Polys": polygons}.items():
        array = vtk.vtkCellArray()
        for cell in cells:
            array.InsertNextCell(len(cell), cell)
        getattr(data, f"Set{name}")(array)
    _add_data(vtk, data)
    _write(vtk.vtkPolyDataWriter(), data, path, version, binary)


def meshio_grid(path: Path, form: str, binary: bool) -> None:
    """Tetrahedra and a triangle, with labels of materials, as meshio writes them."""
    import meshio

    points, tetrahedra = shapes.block()
    half = len(tetrahedra) // 2
    regions = [np.full(half, 1), np.full(len(tetrahedra) - half, 1), np.array([2])]
    cells = [
        ("tetra", tetrahedra[:half]),
        ("tetra", tetrahedra[half:]),
        ("triangle", np.array([[0, 1, 2]]) + len(points)),
    ]
    mesh = meshio.Mesh(np.vstack([points, AWAY]), cells, cell_data={"gmsh:physical": regions})
    mesh.point_data["level"] = np.arange(len(mesh.points)) / 3
    meshio.write(path, mesh, file_format=form, binary=binary)


def old_text(path: Path, end: str, version: str, kind: str) -> None:
    """Small letters, blank lines, cells that are wrapped, and the attributes of old programs."""
    points, triangles = shapes.plate()
    n, m = len(points), len(triangles)
    words = " ".join("3" + "".join(f"  {v}" for v in t) for i, t in enumerate(triangles.tolist()) if i != 5).split()
    lines = [
        f"# vtk DataFile Version {version}", "by an old program, in 1996", "ascii", "", "dataset unstructured_grid", "",
        f"points {n} {kind}", *(f"  {x:+.6f}\t{y:.6E}  {z:g}" for x, y, z in points.tolist()), "",
        f"cells {m + 1} {4 * (m - 1) + 3 + 6}", "2 0 1",
        *(" ".join(words[i : i + 7]) for i in range(0, len(words), 7)), "5 0 1 2 3 4", "",
        f"cell_types {m + 1}", "3", *["5"] * (m - 1), "7", "",
        f"point_data {n}", "scalars level float", "lookup_table grey", *map(str, range(n)),
        "lookup_table grey 2", "0 0 0 1", "1 1 1 1",
        "color_scalars colour 3", *["0.5 0.25 1"] * n, "vectors speed double", *["1 2 3"] * n,
        "texture_coordinates uv 2 float", *["0.5 0.5"] * n,
        f"cell_data {m + 1}", "scalars part int 1", "LOOKUP_TABLE default", *["1"] * (m + 1),
        "field FieldData 1", f"more 2 {m + 1} unsigned_char", *["1 255"] * (m + 1), "",
    ]  # fmt: skip
    path.write_bytes(end.join(lines).encode())


FILES: dict[str, Callable[[Path], None]] = {
    **{
        f"{maker.__name__}_{version}_{'binary' if binary else 'text'}_{'double' if double else 'float'}.vtk": partial(
            maker, version=version, binary=binary, double=double
        )
        for maker in (grid, polydata)
        for version, binary, double in ((42, False, False), (42, True, True), (51, False, True), (51, True, False))
    },
    "meshio_42.vtk": partial(meshio_grid, form="vtk42", binary=True),
    "meshio_51.vtk": partial(meshio_grid, form="vtk", binary=True),
    "meshio_51_text.vtk": partial(meshio_grid, form="vtk", binary=False),
    "old_20.vtk": partial(old_text, end="\n", version="2.0", kind="float"),
    "windows_30.vtk": partial(old_text, end="\r\n", version="3.0", kind="double"),
}


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """What VTK finds: points, and all else."""
    vtk = pytest.importorskip("vtkmodules.all")
    grids = b"unstructured_grid" in path.read_bytes()[:400].lower()
    reader = vtk.vtkUnstructuredGridReader() if grids else vtk.vtkPolyDataReader()
    reader.SetFileName(str(path))
    for what in ("Scalars", "Vectors", "Normals", "Tensors", "ColorScalars", "TCoords", "Fields"):
        getattr(reader, f"ReadAll{what}On")()
    reader.Update()
    data = reader.GetOutput()
    cells = (
        {"cells": data.GetCells()}
        if grids
        else {k: getattr(data, f"Get{k}")() for k in ("Verts", "Lines", "Polys", "Strips")}
    )
    found: dict[str, Any] = {
        "title": reader.GetHeader(),
        "types": [data.GetCellType(i) for i in range(data.GetNumberOfCells())],
    }
    for name, array in cells.items():
        found[name] = [_values(array.GetOffsetsArray()), _values(array.GetConnectivityArray())]
    for place in ("Point", "Cell", "Field"):
        attributes = getattr(data, f"Get{place}Data")()
        for i in range(attributes.GetNumberOfArrays()):
            array = attributes.GetAbstractArray(i)
            names = [array.GetComponentName(c) for c in range(array.GetNumberOfComponents())]
            found[f"{place} {array.GetName()}"] = [array.GetClassName(), names, _values(array)]
    return np.array([data.GetPoint(i) for i in range(data.GetNumberOfPoints())]), found


def _values(array: Any) -> Any:
    numbers = [array.GetVariantValue(i) for i in range(array.GetNumberOfValues())]
    if array.IsNumeric():
        return np.array([number.ToDouble() for number in numbers]).reshape(-1, array.GetNumberOfComponents())
    return [str(number) for number in numbers]
