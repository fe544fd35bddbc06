"""Exodus files that are made of other formats: what they hold, netCDF's library and meshio find, and the reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from laden import TYPES, document_of, laden, members
from splicing import MODULES, make

from meshfix_cli import read, write
from meshfix_cli.meshfile import anew
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.lost import lost
from meshfix_cli.meshfile.reading import parse
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

EXODUS = Format("exodus")


def titles(values: Any) -> list[str]:
    return [row.tobytes().partition(b"\0")[0].decode() for row in np.ma.getdata(values)]


@pytest.mark.parametrize("name", ["every solid", "quads and triangles", "graded quads"])
@pytest.mark.parametrize("kind", TYPES)
def test_all_arrives(kind: str, name: str, tmp_path: Path) -> None:
    document = document_of(laden(kind, name))
    _, dropped = write(document, document.mesh, tmp_path / "out.e", EXODUS)
    source, after = document.source, read(tmp_path / "out.e").source
    assert dropped == ()
    assert after.points.tobytes() == source.points.tobytes()
    ordered = after.in_order().merged()
    found = {run.type: i for i, run in enumerate(ordered.cells)}
    for k, run in enumerate(source.cells):
        i = found[run.type]
        np.testing.assert_array_equal(run.vertices, ordered.cells[i].vertices)
        np.testing.assert_array_equal(source.arrays.cell["quality"][k], ordered.arrays.cell["quality"][i])
        labels = ordered.arrays.cell[after.regions[0]][i]
        np.testing.assert_array_equal(source.arrays.cell["gmsh:physical"][k], labels)
    np.testing.assert_array_equal(after.arrays.point["velocity"], source.arrays.point["velocity"])
    groups, expected = members(after), members(source)
    assert {one: groups[one] for one in expected} == expected
    assert sorted(read(tmp_path / "out.e").fixed.values()) == sorted(document.fixed.values())


def test_the_library_of_netcdf_finds_blocks_and_sets(tmp_path: Path) -> None:
    netcdf = pytest.importorskip("netCDF4")
    source = laden()
    (tmp_path / "out.e").write_bytes(anew.written(anew.prepared(source, EXODUS), source.points, EXODUS))
    groups = groups_of(source)
    with netcdf.Dataset(tmp_path / "out.e") as file:
        named = titles(file["eb_names"][:])
        assert {"steel_tetra", "steel_hexahedron", "copper_wedge"} <= set(named)
        numbers = file["eb_prop1"][:].tolist()
        assert len(set(numbers)) == len(numbers)
        assert set(titles(file["els_names"][:])) == {"probe", "steel", "copper", "hot_wall"}
        assert titles(file["ns_names"][:]) == ["clamped"]
        assert file["node_ns1"][:].tolist() == (source.arrays.point_sets["clamped"] + 1).tolist()
        assert titles(file["name_nod_var"][:]) == ["temperature", "velocity_x", "velocity_y", "velocity_z"]
        sides = [len(file[f"elem_ss{i}"][:]) for i in range(1, file.dimensions["num_side_sets"].size + 1)]
        assert sum(sides) == sum(len(rows) for _, rows in groups["hot_wall"].cells)
        first = len(file["connect1"][:])
        np.testing.assert_array_equal(file["vals_elem_var2eb1"][0][:3], source.arrays.cell["quality"][0][
            file["elem_num_map"][:first] - 1][:3])  # fmt: skip


def test_meshio_reads_the_same(tmp_path: Path) -> None:
    source = laden()
    (tmp_path / "out.e").write_bytes(anew.written(anew.prepared(source, EXODUS), source.points, EXODUS))
    mesh = meshio.read(tmp_path / "out.e")
    np.testing.assert_array_equal(mesh.points, source.points)
    for run in source.cells:
        found = np.concatenate([block.data for block in mesh.cells if block.type == run.type])
        np.testing.assert_array_equal(np.unique(found, axis=0), np.unique(run.vertices, axis=0))
    assert mesh.point_sets["clamped"].tolist() == source.arrays.point_sets["clamped"].tolist()


def test_sides_are_those_of_the_facets(tmp_path: Path) -> None:
    """Whatever the element, and of either order: the reader finds the nodes of each."""
    for kind, name in (("linear", "every solid"), ("serendipity", "every solid")):
        source = laden(kind, name)
        back = parse(anew.written(anew.prepared(source, EXODUS), source.points, EXODUS), EXODUS)
        wall = groups_of(source)["hot_wall"].points
        found = [rows for one, rows in back.arrays.point_sets.items() if one.endswith("_sides")]
        np.testing.assert_array_equal(np.unique(np.concatenate(found)), wall)


def test_blocks_alone_tell_materials_that_have_one_type(tmp_path: Path) -> None:
    """With their numbers, and the order of elements in their numbers."""
    labels, heat = np.array([4, 9, 4]), np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]])
    arrays = Arrays(
        point={"heat": np.arange(5.0)}, cell={"ref": [labels], "flux": [heat], "six": [np.ones((3, 6))]},
        groups={"a name of more than thirty-two characters": np.array([4, 3])}, cell_sets={"both": [np.array([1, 2])]},
    )  # fmt: skip
    points = np.random.default_rng(0).random((5, 3))
    tets = np.array([[0, 1, 2, 3], [1, 2, 3, 4], [0, 2, 3, 4]])
    source = Source(points, [Cells("tetra", tets)], load=lambda: arrays, regions=("ref",))
    back = parse(anew.written(anew.prepared(source, EXODUS), points, EXODUS), EXODUS)
    assert back.regions == ("exodus:block",)
    assert [run.ids.tolist() for run in back.cells if run.ids is not None] == [[1, 3], [2]]
    assert [values.tolist() for values in back.arrays.cell["exodus:block"]] == [[4, 4], [9]]
    assert back.arrays.groups.keys() == {"a name of more than thirty-two characters", "block_9"}
    assert lost(source, back.in_order()) == ("cell data six",)


@pytest.mark.parametrize(("reader", "variant"), [("abaqus", None), ("gmsh", "groups_text_4.msh"), ("vtu", None)])
def test_files_of_other_formats_become_such(reader: str, variant: str | None, tmp_path: Path) -> None:
    document = read(make(reader, variant or next(iter(MODULES[reader].FILES)), tmp_path))
    _, dropped = write(document, document.mesh, tmp_path / "out.e", EXODUS)
    assert not [one for one in dropped if one.startswith(("group", "point data"))]
    before, after = document.groups(), read(tmp_path / "out.e").groups()
    assert {name: after[name] for name in before} == before
    data = (tmp_path / "out.e").read_bytes()
    write(document, document.mesh, tmp_path / "out.e", EXODUS)
    assert (tmp_path / "out.e").read_bytes() == data
