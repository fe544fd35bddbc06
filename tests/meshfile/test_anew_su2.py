"""SU2 files made of other formats: meshio finds points, elements and markers there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from elements import MESHES
from named_groups import members, named, written_as

from meshfix_cli import read, write
from meshfix_cli.errors import WriteError
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

FORM = Format("su2")


def test_points_elements_and_markers_arrive(tmp_path: Path) -> None:
    source, nothing = named(), np.empty(0, dtype=np.int64)
    given = source.arrays
    labels = [given.cell["material"][0], np.where(np.arange(40) < 15, 7, 0)]
    sets = {"both": given.cell_sets["both"], "all": [nothing, np.arange(40)], "cold": [nothing, np.arange(20, 30)]}
    arrays = replace(given, cell={"material": labels}, cell_sets=sets)
    source = replace(source, load=lambda: arrays)
    back, lost = written_as(source, FORM, tmp_path / "out.su2")
    assert set(lost) == {
        "point data heat", "point data load", "cell data material", "group steel", "group copper", "group hot wall",
        "group both", "group corner", "group all",
    }  # fmt: skip
    np.testing.assert_array_equal(back.points, source.points)
    np.testing.assert_array_equal(back.vertices_of("tetra", 4), source.cells[0].vertices)
    expected, found = members(source), members(back)
    assert list(found) == ["hot_wall", "cold", "unmarked"]
    assert found["hot_wall"] == expected["hot wall"] and found["cold"] == expected["cold"]
    assert len(found["unmarked"]) == 15
    mesh = meshio.read(tmp_path / "out.su2")
    np.testing.assert_array_equal(mesh.points, source.points)
    np.testing.assert_array_equal(mesh.cells_dict["tetra"], source.cells[0].vertices)
    assert len(mesh.cells_dict["triangle"]) == 40
    assert np.unique(mesh.cell_data_dict["su2:tag"]["triangle"], return_counts=True)[1].tolist() == [15, 10, 15]
    written_as(source, FORM, tmp_path / "again.su2")
    assert (tmp_path / "again.su2").read_bytes() == (tmp_path / "out.su2").read_bytes()


@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_all_elements_arrive(name: str, tmp_path: Path) -> None:
    """A mesh in the plane of z = 0 is one of two dimensions."""
    points, cells = MESHES[name]()
    lines = Cells("line", cells[0][1][:, :2])
    source = Source(points, [*(Cells(key, rows) for key, rows in cells), lines])
    flat = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    for here in (source, replace(source, points=flat)):
        back, lost = written_as(here, FORM, tmp_path / "out.su2")
        assert lost == (("line cells",) if name == "every solid" else ())
        np.testing.assert_array_equal(back.points, points)
        mesh = meshio.read(tmp_path / "out.su2")
        for key, rows in cells:
            np.testing.assert_array_equal(back.vertices_of(key, rows.shape[1]), rows)
            np.testing.assert_array_equal(mesh.cells_dict[key], rows)


def test_other_cells_are_left_out(tmp_path: Path) -> None:
    points, cells = MESHES["quads and triangles"]()
    empty, polygon = np.empty((0, 3), dtype=np.int64), np.array([[0, 1, 2, 3, 4]])
    runs = [
        *(Cells(key, rows) for key, rows in cells),
        Cells("polygon", polygon),
        Cells("line", empty[:, :2]),
        Cells("triangle", empty),
    ]
    _, lost = written_as(Source(points, runs), FORM, tmp_path / "out.su2")
    assert "polygon cells" in lost


def test_surfaces_in_space_have_no_place(tmp_path: Path) -> None:
    points, cells = MESHES["quads and triangles"]()
    bent = np.column_stack([points, np.sin(points[:, 0])])
    source = Source(bent, [Cells(key, rows) for key, rows in cells])
    with pytest.raises(WriteError, match="that holds no quadrilaterals in space"):
        written_as(source, FORM, tmp_path / "out.su2")


@pytest.mark.parametrize("form", [Format("gmsh", True), Format("gmsh22", False), Format("medit"), Format("abaqus")])
def test_facets_of_other_formats_become_markers(form: Format, tmp_path: Path) -> None:
    """By the name of their group, or by its number."""
    written_as(named(), form, tmp_path / "in")
    document = read(tmp_path / "in")
    write(document, document.mesh, tmp_path / "out.su2")
    after = read(tmp_path / "out.su2")
    assert after.mesh.check()[0] == 0
    name = {"medit": "7"}.get(form.name, "hot_wall")
    assert {key: len(rows) for key, rows in members(after.source).items()} == {name: 40}


def test_an_array_alone_gives_markers_their_numbers(tmp_path: Path) -> None:
    source = named()
    labels = [np.ones(len(source.cells[0].vertices), dtype=np.int64), np.arange(40) // 10]
    arrays = Arrays(cell={"material": labels})
    back, _ = written_as(replace(source, load=lambda: arrays), FORM, tmp_path / "out.su2")
    assert {name: len(rows) for name, rows in members(back).items()} == {"1": 10, "2": 10, "3": 10, "unmarked": 10}
