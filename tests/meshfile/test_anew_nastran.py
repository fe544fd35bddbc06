"""Decks of Nastran made of other formats: meshio finds points, elements and properties there."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from elements import MESHES
from named_groups import named, written_as
from programs import gmsh_session
from refined import SERENDIPITY, refined

from meshfix_cli import read, write
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

FORM = Format("nastran")


def test_points_elements_and_properties_arrive(tmp_path: Path) -> None:
    source = named()
    back, lost = written_as(source, FORM, tmp_path / "out.bdf")
    assert set(lost) == {
        "point data heat", "point data load", "cell data rate", "group steel", "group copper", "group hot wall",
        "group both", "group corner",
    }  # fmt: skip
    np.testing.assert_allclose(back.points, source.points, rtol=1e-9, atol=1e-9)
    labels = np.concatenate(source.arrays.cell["material"])
    np.testing.assert_array_equal(np.concatenate(back.arrays.cell["nastran:ref"]), labels)
    np.testing.assert_array_equal(back.arrays.point_sets["SPC 1"], source.arrays.point_sets["corner"])
    found = meshio.read(tmp_path / "out.bdf")
    np.testing.assert_allclose(found.points, back.points, rtol=1e-12)
    for run, block in zip(source.cells, found.cells, strict=True):
        np.testing.assert_array_equal(block.data, run.vertices)
    np.testing.assert_array_equal(np.concatenate(found.cell_data["nastran:ref"]), labels)
    written_as(source, FORM, tmp_path / "again.bdf")
    text = (tmp_path / "out.bdf").read_text()
    assert (tmp_path / "again.bdf").read_text() == text
    assert max(map(len, text.splitlines())) <= 72


@pytest.mark.parametrize("types", [SERENDIPITY, {}], ids=["second", "first"])
@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_all_elements_arrive(name: str, types: dict[str, str], tmp_path: Path) -> None:
    points, cells = MESHES[name]()
    points, cells = refined(points, cells, types) if types else (points, cells)
    if name != "every solid" and types:
        cells = [*cells, ("line3", cells[0][1][:, [0, 1, 4]]), ("line", cells[0][1][:, :2])]
    back, lost = written_as(Source(points, [Cells(key, rows) for key, rows in cells]), FORM, tmp_path / "out.bdf")
    assert lost == () and back.points.shape[1] == 3
    for key, rows in cells:
        np.testing.assert_array_equal(back.vertices_of(key, rows.shape[1]), rows)
    if name == "every solid" and not types:  # meshio does not read all others
        for block in meshio.read(tmp_path / "out.bdf").cells:
            np.testing.assert_array_equal(block.data, dict(cells)[block.type])


def test_no_two_dimensions_have_a_property_in_common(tmp_path: Path) -> None:
    source, nothing = named(), np.empty(0, dtype=np.int64)
    labels = [np.arange(len(source.cells[0].vertices)) % 3, np.arange(40) % 2]
    sets = {"some": [nothing, np.arange(0, 40, 2)[:5]]}
    arrays = Arrays(cell={"material": labels}, cell_sets=sets)
    back, _ = written_as(replace(source, load=lambda: arrays), FORM, tmp_path / "out.bdf")
    solids, faces = back.arrays.cell["nastran:ref"]
    assert not {*solids.tolist()} & {*faces.tolist()} and solids.min() > 0
    for found, given, count in ((solids, labels[0], 3), (faces, labels[1], 3)):
        assert len(np.unique(found)) == count
        assert len(np.unique(np.column_stack([found, given]), axis=0)) == count
    assert solids[labels[0] > 0].tolist() == labels[0][labels[0] > 0].tolist()


def test_constraints_keep_their_numbers(tmp_path: Path) -> None:
    source = named()
    sets = {"SPC 7": np.arange(13), "wall": np.array([2, 5])}
    arrays = Arrays(point_sets=sets)
    back, lost = written_as(replace(source, load=lambda: arrays, regions=()), FORM, tmp_path / "out.bdf")
    assert lost == ("group wall",)
    assert {name: rows.tolist() for name, rows in back.arrays.point_sets.items()} == {
        "SPC 7": list(range(13)), "SPC 8": [2, 5],
    }  # fmt: skip
    assert len(re.findall(r"(?m)^SPC1 ", (tmp_path / "out.bdf").read_text())) == 4


def test_gmsh_reads_wedges_beside_constraints(tmp_path: Path) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]])
    arrays = Arrays(point_sets={"SPC 1": np.array([0, 2])})
    source = Source(points, [Cells("wedge", np.arange(6)[None])], load=lambda: arrays)
    written_as(source, FORM, tmp_path / "out.bdf")
    with gmsh_session() as gmsh:
        gmsh.open(str(tmp_path / "out.bdf"))
        assert gmsh.model.mesh.getElements()[2][0].tolist() == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("form", [Format("gmsh22", True), Format("vtu", True), Format("medit"), Format("abaqus")])
def test_files_of_other_formats_become_one(form: Format, tmp_path: Path) -> None:
    """Their materials are told apart as they were."""
    written_as(named(), form, tmp_path / "in")
    document = read(tmp_path / "in")
    write(document, document.mesh, tmp_path / "out.bdf")
    after = read(tmp_path / "out.bdf")
    assert after.mesh.check()[0] == 0
    for mine, theirs in zip(after.regions, document.regions, strict=True):
        assert len(np.unique(np.column_stack([mine, theirs]), axis=0)) == len(np.unique(theirs)) > 1
