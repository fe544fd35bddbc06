"""Files of gmsh made of other formats: gmsh opens them, and finds the groups, the nodes and the data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from elements import MESHES
from named_groups import members, named, written_as
from programs import gmsh_session
from refined import COMPLETE, SERENDIPITY, refined

from meshfix_cli import read, write
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

OLD, NEW = [Format("gmsh22", False), Format("gmsh22", True)], [Format("gmsh", False), Format("gmsh", True)]
WHOLE = {**COMPLETE, "pyramid": "pyramid14"}


def in_gmsh(path: Path) -> dict[str, Any]:
    """What gmsh finds: nodes, elements of each group by their nodes, and entities of nodes by their dimension."""
    with gmsh_session() as gmsh:
        gmsh.open(str(path))
        mesh = gmsh.model.mesh
        tags, points, _ = mesh.getNodes()
        groups = {}
        for dimension, number in gmsh.model.getPhysicalGroups():
            rows = []
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, number):
                for kind, nodes in zip(*mesh.getElements(dimension, entity)[::2], strict=True):
                    size = mesh.getElementProperties(kind)[3]
                    rows += np.sort(np.asarray(nodes, dtype=np.int64).reshape(-1, size) - 1, axis=1).tolist()
            groups[gmsh.model.getPhysicalName(dimension, number)] = sorted(rows)
        owners = {d: sum(len(mesh.getNodes(*key)[0]) for key in gmsh.model.getEntities(d)) for d in range(4)}
        views = {}
        for view in gmsh.view.getTags():
            name = gmsh.view.option.getString(view, "Name")
            views[name] = np.array(gmsh.view.getHomogeneousModelData(view, 0)[2])
        return {
            "points": np.asarray(points).reshape(-1, 3)[np.argsort(tags)], "groups": groups, "owners": owners,
            "views": views,
        }  # fmt: skip


@pytest.mark.parametrize("form", [*OLD, *NEW])
def test_gmsh_finds_groups_nodes_and_data(form: Format, tmp_path: Path) -> None:
    source = named()
    back, lost = written_as(source, form, tmp_path / "out.msh")
    several = form in NEW
    assert set(lost) == {"group corner", *([] if several else ["group both"])}
    expected = {name: rows for name, rows in members(source).items() if f"group {name}" not in lost}
    found = in_gmsh(tmp_path / "out.msh")
    assert members(back) == found["groups"] == expected
    for points in (back.points, found["points"]):
        np.testing.assert_array_equal(points, source.points)
    given, on_wall = source.arrays, len(np.unique(source.cells[1].vertices))
    assert found["owners"] == {0: 0, 1: 0, 2: on_wall, 3: len(source.points) - on_wall}
    data = {**given.point, "rate": np.concatenate(given.cell["rate"])}
    assert found["views"].keys() == data.keys()
    for name, values in data.items():
        np.testing.assert_array_equal(found["views"][name], values.ravel())
    physical = np.concatenate(back.arrays.cell["gmsh:physical"])
    np.testing.assert_array_equal(physical, np.concatenate(given.cell["material"]))
    np.testing.assert_array_equal(back.vertices_of("tetra", 4), source.cells[0].vertices)
    again, _ = written_as(source, form, tmp_path / "again.msh")
    assert (tmp_path / "again.msh").read_bytes() == (tmp_path / "out.msh").read_bytes() and len(again.points)


@pytest.mark.parametrize("form", [*OLD, *NEW])
@pytest.mark.parametrize(
    "types", [SERENDIPITY, {**COMPLETE, "pyramid": "pyramid14"}, {}], ids=["serendipity", "complete", "linear"]
)
@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_meshio_and_gmsh_find_all_elements(name: str, types: dict[str, str], form: Format, tmp_path: Path) -> None:
    points, cells = MESHES[name]()
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    points, cells = refined(points, cells, types) if types else (points, cells)
    labels = [np.arange(len(rows)) * 3 // len(rows) + 1 for _, rows in cells]
    source = Source(points, [Cells(key, rows) for key, rows in cells], load=lambda: Arrays(cell={"material": labels}))
    back, lost = written_as(replace(source, regions=("material",)), form, tmp_path / "out.msh")
    assert lost == ()
    meshes = [back.cells]
    if name != "every solid" or not types:  # meshio does not know all of them
        meshes.append([Cells(one.type, one.data) for one in meshio.read(tmp_path / "out.msh").cells])
    for found in meshes:
        for key, rows in cells:
            np.testing.assert_array_equal(np.concatenate([run.vertices for run in found if run.type == key]), rows)
    opened = in_gmsh(tmp_path / "out.msh")
    assert len(opened["points"]) == len(points)
    assert len(opened["groups"]) == 1  # none has a name
    assert opened["views"] == {}


def test_groups_that_overlap_survive_from_gmsh_to_gmsh(tmp_path: Path) -> None:
    source = named()
    first, _ = written_as(source, NEW[0], tmp_path / "in.msh")
    write(read(tmp_path / "in.msh"), read(tmp_path / "in.msh").mesh, tmp_path / "out.msh", NEW[1])
    assert members(read(tmp_path / "out.msh").source) == members(first)
    assert in_gmsh(tmp_path / "out.msh")["groups"] == members(first)


def test_sets_that_share_no_element_are_groups_of_old_files(tmp_path: Path) -> None:
    """Of those that do the small ones: a set of all would leave none of the others."""
    source, nothing = named(), np.empty(0, dtype=np.int64)
    n = len(source.cells[0].vertices)
    sets = {"all": [np.arange(n), nothing], "left": [np.arange(9), nothing], "left too": [np.arange(9), nothing],
            "right": [np.arange(9, 20), np.arange(5)]}  # fmt: skip
    arrays = Arrays(cell_sets=sets)
    back, lost = written_as(replace(source, load=lambda: arrays, regions=()), OLD[0], tmp_path / "out.msh")
    assert lost == ("group all",)
    expected = members(Source(source.points, source.cells, load=lambda: arrays))
    del expected["all"]
    assert members(back) == expected
    assert {name: len(rows) for name, rows in in_gmsh(tmp_path / "out.msh")["groups"].items()} in (
        {"left": 9, "right": 16}, {"left": 9, "right": 5}, {"left": 9, "right": 11}, {"left too": 9, "right": 5}
    )  # fmt: skip


def test_numbers_that_gmsh_has_not_are_numbered_anew(tmp_path: Path) -> None:
    source = named()
    labels = [np.where(source.arrays.cell["material"][0] == 1, -4, 2**40), np.full(40, 5)]
    arrays = Arrays(cell={"material": labels})
    for form in (*OLD, *NEW):
        back, lost = written_as(replace(source, load=lambda: arrays), form, tmp_path / "out.msh")
        assert lost == ()
        found = np.concatenate(back.arrays.cell["gmsh:physical"])
        assert np.unique(found).tolist() == [1, 2, 3]
        assert len(np.unique(np.column_stack([found, np.concatenate(labels)]), axis=0)) == 3


def test_data_that_are_not_everywhere_stay_so(tmp_path: Path) -> None:
    source = named()
    values = np.where(np.arange(len(source.points)) % 3 == 0, np.nan, 0.1)
    arrays = Arrays(point={'a "b"': values, "word": np.full(len(values), "x")})
    for form in (*OLD, *NEW):
        back, lost = written_as(replace(source, load=lambda: arrays, regions=()), form, tmp_path / "out.msh")
        assert lost == ("point data word",)
        np.testing.assert_array_equal(back.arrays.point["a 'b'"], values)
