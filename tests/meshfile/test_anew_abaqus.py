"""Abaqus files made of other formats: meshio finds the elements, sets and sections there."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from elements import MESHES
from named_groups import members, named, written_as
from refined import SERENDIPITY, refined

from meshfix_cli import read, write
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

FORM = Format("abaqus")


def test_materials_sets_and_points_arrive(tmp_path: Path) -> None:
    source = named()
    back, lost = written_as(source, FORM, tmp_path / "out.inp")
    assert set(lost) == {"point data heat", "point data load", "cell data material", "cell data rate", "group hot wall"}
    expected = {name.replace(" ", "_"): rows for name, rows in members(source).items()}
    assert members(back) == expected
    np.testing.assert_allclose(back.points, source.points, rtol=1e-12, atol=1e-15)  # of 20 characters
    assert back.regions
    (labels, *_) = back.arrays.cell[back.regions[0]]
    np.testing.assert_array_equal(labels, source.arrays.cell["material"][0])
    found = meshio.read(tmp_path / "out.inp")
    np.testing.assert_array_equal(found.points, back.points)
    for run, block in zip(source.cells, found.cells, strict=True):
        np.testing.assert_array_equal(block.data, run.vertices)
    assert {name: sum(len(rows) for rows in runs if rows is not None) for name, runs in found.cell_sets.items()} == {
        name: len(rows) for name, rows in expected.items() if name != "corner"
    }
    np.testing.assert_array_equal(found.point_sets["corner"], source.arrays.point_sets["corner"])
    text = (tmp_path / "out.inp").read_text()
    assert re.findall(r"\*SOLID SECTION, ELSET=(\w+)", text) == ["steel", "copper"]
    assert max(map(len, text.splitlines())) <= 256
    written_as(source, FORM, tmp_path / "again.inp")
    assert (tmp_path / "again.inp").read_text() == text


@pytest.mark.parametrize("types", [SERENDIPITY, {}], ids=["second", "first"])
@pytest.mark.parametrize("name", ["every solid", "quads and triangles", "curved"])
def test_all_elements_arrive(name: str, types: dict[str, str], tmp_path: Path) -> None:
    points, cells = MESHES["quads and triangles" if name == "curved" else name]()
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    if name == "curved":
        points[:, 2] = np.sin(points[:, 0])
    cells = [(key, rows) for key, rows in cells if not types or key != "pyramid"]  # Abaqus has none of second order
    points, cells = refined(points, cells, types) if types else (points, cells)
    source = Source(points, [Cells(key, rows) for key, rows in cells])
    back, lost = written_as(source, FORM, tmp_path / "out.inp")
    assert lost == ()
    for key, rows in cells:
        np.testing.assert_array_equal(back.vertices_of(key, rows.shape[1]), rows)
    there = re.findall(r"TYPE=(\w+)", (tmp_path / "out.inp").read_text())
    if name == "quads and triangles":
        assert sorted(there) == (["CPS6", "CPS8"] if types else ["CPS3", "CPS4"])
        return
    if name == "every solid":  # meshio does not know all of them
        assert sorted(there) == (["C3D10", "C3D15", "C3D20"] if types else ["C3D4", "C3D5", "C3D6", "C3D8"])
        return
    for block in meshio.read(tmp_path / "out.inp").cells:
        np.testing.assert_array_equal(block.data, dict(cells)[block.type])


def test_no_two_names_are_the_same_in_capitals(tmp_path: Path) -> None:
    source, nothing = named(), np.empty(0, dtype=np.int64)
    names = ["1st", "wall", "Wall", "süd/ost", "x" * 90]
    sets = {name: [np.arange(i, i + 3), nothing] for i, name in enumerate(names)}
    arrays = Arrays(cell_sets=sets, point_sets={"wall": np.array([4, 2])})
    back, _ = written_as(replace(source, load=lambda: arrays, regions=()), FORM, tmp_path / "out.inp")
    found = list(back.arrays.cell_sets)
    assert found == ["set_1st", "wall", "Wall_2", "s_d_ost", "x" * 80]
    assert [rows[0].tolist() for rows in back.arrays.cell_sets.values()] == [[i, i + 1, i + 2] for i in range(5)]
    assert back.arrays.point_sets["wall"].tolist() == [2, 4]
    assert not np.concatenate(back.arrays.cell["abaqus:section"]).any()  # sets that are not of all


def test_vertices_of_a_group_are_a_set_of_nodes(tmp_path: Path) -> None:
    source = named()
    cells = [*source.cells, Cells("vertex", np.array([[3], [8]]))]
    arrays = Arrays(
        cell={"material": [*source.arrays.cell["material"], np.array([9, 9])]}, groups={"ends": np.array([9, 0])}
    )
    back, lost = written_as(replace(source, cells=cells, load=lambda: arrays), FORM, tmp_path / "out.inp")
    assert "vertex cells" in lost and "group ends" not in lost
    assert back.arrays.point_sets["ends"].tolist() == [3, 8]
    assert list(back.arrays.cell_sets) == ["region_1", "region_2"]


@pytest.mark.parametrize("form", [Format("gmsh", False), Format("vtu", True), Format("medit")])
def test_files_of_other_formats_become_one(form: Format, tmp_path: Path) -> None:
    """Their materials are told apart as they were."""
    path = tmp_path / "in"
    written_as(named(), form, path)
    document = read(path)
    write(document, document.mesh, tmp_path / "out.inp")
    after = read(tmp_path / "out.inp")
    assert after.mesh.check()[0] == 0
    assert len(after.regions) == len(document.regions) == 1
    for mine, theirs in zip(after.regions, document.regions, strict=True):
        assert len(np.unique(np.column_stack([mine, theirs]), axis=0)) == len(np.unique(theirs)) > 1
