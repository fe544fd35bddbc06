"""Files of VTK that are made of other formats: what they hold, VTK and meshio find there, and so does the reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from laden import TYPES, document_of, laden, members
from splicing import MODULES, make

from meshfix_cli import read, write
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.lagrange import kinds
from meshfix_cli.meshfile import anew
from meshfix_cli.meshfile.formats import sniff
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.lost import lost
from meshfix_cli.meshfile.reading import parse
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

FORMS = [Format(name, binary) for name in ("vtu", "vtk", "vtk42") for binary in (False, True)]
ODD = 'a <b> & "c" %20'
each_form = pytest.mark.parametrize("form", FORMS, ids=lambda form: f"{form.name}-{form.binary}")


def in_vtk(path: Path) -> Any:
    """The grid that VTK reads."""
    if path.suffix == ".vtu":
        reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLUnstructuredGridReader()
    else:
        reader = pytest.importorskip("vtkmodules.vtkIOLegacy").vtkUnstructuredGridReader()
        reader.ReadAllFieldsOn()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def arrays_in(data: Any) -> dict[str, Any]:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


@each_form
@pytest.mark.parametrize("kind", TYPES)
def test_all_arrives(form: Format, kind: str, tmp_path: Path) -> None:
    document = document_of(laden(kind))
    path = tmp_path / ("out.vtu" if form.name == "vtu" else "out.vtk")
    _, dropped = write(document, document.mesh, path, form)
    source, after = document.source, read(path).source
    assert dropped == ()
    assert sniff(path.read_bytes()) == form
    assert after.points.tobytes() == source.points.tobytes()
    assert after.regions == ("gmsh:physical",)
    assert [run.type for run in after.cells] == [run.type for run in source.cells]
    for mine, theirs in zip(source.cells, after.cells, strict=True):
        np.testing.assert_array_equal(mine.vertices, theirs.vertices)
    for name in ("gmsh:physical", "quality"):
        for values, others in zip(source.arrays.cell[name], after.arrays.cell[name], strict=True):
            np.testing.assert_array_equal(values, others)
    assert members(after) == members(source)
    assert read(path).fixed == document.fixed


@each_form
def test_vtk_reads_the_same(form: Format, tmp_path: Path) -> None:
    source = laden()
    path = tmp_path / ("out.vtu" if form.name == "vtu" else "out.vtk")
    path.write_bytes(anew.written(source, source.points, form))
    grid = in_vtk(path)
    points = np.array([grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())])
    np.testing.assert_array_equal(points, source.points)
    rows = [(run.type, row) for run in source.cells for row in run.vertices.tolist()]
    for i, (key, row) in enumerate(rows):
        cell = grid.GetCell(i)
        assert grid.GetCellType(i) == ELEMENTS[key].vtk
        assert [cell.GetPointId(k) for k in range(cell.GetNumberOfPoints())] == row
    cell, point = arrays_in(grid.GetCellData()), arrays_in(grid.GetPointData())
    np.testing.assert_array_equal(cell["gmsh:physical"], np.concatenate(source.arrays.cell["gmsh:physical"]))
    np.testing.assert_array_equal(point["velocity"], source.arrays.point["velocity"])
    assert np.flatnonzero(point["clamped"]).tolist() == source.arrays.point_sets["clamped"].tolist()
    assert cell["probe"].sum() == sum(map(len, source.arrays.cell_sets["probe"]))
    assert {name: about.tolist() for name, about in arrays_in(grid.GetFieldData()).items()} == {
        "steel": [1, 3], "copper": [2, 3], "hot_wall": [7, 2]
    }  # fmt: skip


@each_form
def test_meshio_reads_the_same(form: Format, tmp_path: Path) -> None:
    source = laden()
    if form.name == "vtk":  # of which meshio's reader of 5.1 does not know VTK's words for bytes
        bare = Arrays(source.arrays.point, source.arrays.cell, source.arrays.groups)
        source = Source(source.points, source.cells, load=lambda: bare, regions=source.regions)
    path = tmp_path / ("out.vtu" if form.name == "vtu" else "out.vtk")
    path.write_bytes(anew.written(source, source.points, form))
    mesh = meshio.read(path)
    np.testing.assert_array_equal(mesh.points, source.points)
    np.testing.assert_array_equal(mesh.point_data["velocity"], source.arrays.point["velocity"])
    assert [block.type for block in mesh.cells] == [run.type for run in source.cells]
    for labels, expected in zip(mesh.cell_data["gmsh:physical"], source.arrays.cell["gmsh:physical"], strict=True):
        np.testing.assert_array_equal(labels.ravel(), expected)


@each_form
def test_elements_of_any_order_are_in_the_order_of_the_version(form: Format, tmp_path: Path) -> None:
    keys = [
        name for name, kind in kinds().items() if kind.complete and kind.family != "pyramid" and kind.order in (3, 4)
    ]
    at, cells = 0, []
    for key in keys:
        nodes = len(kinds()[key].places())
        cells.append(Cells(key, np.arange(at, at + nodes)[None]))
        at += nodes
    source = Source(np.random.default_rng(0).random((at, 3)), cells)
    again = parse(anew.written(source, source.points, form), form)
    assert [run.type for run in again.cells] == keys
    for mine, theirs in zip(cells, again.cells, strict=True):
        np.testing.assert_array_equal(mine.vertices, theirs.vertices)


@each_form
def test_odd_names_and_types_of_numbers(form: Format) -> None:
    arrays = Arrays(
        point={
            ODD: np.array([0.1, np.pi, 1e-300]), "single": np.array([[0.1, 2, 3]] * 3, dtype=np.float32),
            "truth": np.array([True, False, True]), "largest": np.array([2**63 - 1, 0, -5]),
            "matrix": np.arange(27.0).reshape(3, 3, 3),
        },
        cell={"domain mark": [np.array([3, 3])], "probe": [np.array([0.5, 1])], "grün": [np.array([-(2**31), 4])]},
        cell_sets={"probe": [np.array([0])]},
    )  # fmt: skip
    source = Source(
        np.eye(3), [Cells("triangle", np.array([[0, 1, 2], [0, 2, 1]]))], load=lambda: arrays, regions=("domain mark",)
    )
    back = parse(anew.written(source, source.points, form), form)
    assert back.regions == ("MaterialIDs",)
    assert set(back.arrays.cell) == {"MaterialIDs", "probe", "grün", "probe (set)"}
    np.testing.assert_array_equal(back.arrays.point[ODD], arrays.point[ODD])
    np.testing.assert_array_equal(back.arrays.point["largest"], arrays.point["largest"])
    assert back.arrays.point["single"].dtype == np.float32
    assert groups_of(back)["truth"].nodes.tolist() == [0, 2]
    assert lost(source, back) == ("group probe",)


@each_form
def test_vtk_reads_cells_of_one_type(form: Format, tmp_path: Path) -> None:
    """Connectivity has one column, also where all cells have equally many points."""
    (tmp_path / "in.off").write_text("OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n")
    document = read(tmp_path / "in.off")
    path = tmp_path / ("out.vtu" if form.name == "vtu" else "out.vtk")
    path.write_bytes(anew.written(document.source, document.source.points, form))
    grid = in_vtk(path)
    assert grid.GetNumberOfCells() == 2
    assert [grid.GetCell(1).GetPointId(k) for k in range(3)] == [0, 2, 3]


@each_form
def test_files_of_other_formats_become_such(form: Format, tmp_path: Path) -> None:
    """With their groups, and in the same bytes each time."""
    for reader, variant in (("abaqus", "sets.inp"), ("gmsh", "groups_text_4.msh"), ("exodus", "")):
        variants = MODULES[reader].FILES
        document = read(make(reader, variant if variant in variants else next(iter(variants)), tmp_path))
        path = tmp_path / ("out.vtu" if form.name == "vtu" else "out.vtk")
        _, dropped = write(document, document.mesh, path, form)
        assert not [one for one in dropped if one.startswith(("group", "point data", "cell data"))]
        data = path.read_bytes()
        write(document, document.mesh, path, form)
        assert path.read_bytes() == data
        before, after = document.groups(), read(path).groups()
        assert {name: after[name] for name in before} == before


def test_a_group_of_a_converted_file_can_be_held(tmp_path: Path) -> None:
    document = document_of(laden())
    write(document, document.mesh, tmp_path / "out.vtu", Format("vtu", True))
    for name in ("probe", "clamped", "hot_wall"):
        held = read(tmp_path / "out.vtu", fix=name, regions="none")
        assert not held.mesh.movable[groups_of(held.source)[name].points].any()
