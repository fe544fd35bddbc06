"""Groups and sets of files: what is in them, that `--fix` holds them, and that a report lists them."""

from __future__ import annotations

import json
from pathlib import Path

import meshio
import numpy as np
import pytest
import shapes
from commands import error_line, run
from files_abaqus import elements, nodes, numbers
from files_gmsh import boxes, by_gmsh
from numpy.typing import NDArray
from programs import gmsh_session
from splicing import FORMATS, MODULES, make

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.groups import groups_of

WITH_GROUPS = {"gmsh", "abaqus", "su2"}
VERSIONS = ["groups_text_2.msh", "groups_binary_2.msh", "groups_text_4.msh", "groups_binary_4.msh"]


def of_gmsh(path: Path) -> dict[str, tuple[int, int, list[float]]]:
    """Dimension, number of distinct elements and sorted coordinates of each group, as gmsh has them."""
    found = {}
    with gmsh_session() as gmsh:
        gmsh.open(str(path))
        for dimension, tag in gmsh.model.getPhysicalGroups():
            entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)
            listed = [gmsh.model.mesh.getElements(dimension, one)[2] for one in entities]
            corners = np.concatenate([np.concatenate(rows).reshape(-1, dimension + 1) for rows in listed])
            points = gmsh.model.mesh.getNodesForPhysicalGroup(dimension, tag)[1]
            number = len(np.unique(np.sort(corners, axis=1), axis=0))
            found[gmsh.model.getPhysicalName(dimension, tag)] = (dimension, number, sorted(points.tolist()))
    return found


@pytest.mark.parametrize("variant", VERSIONS)
def test_groups_of_gmsh_are_what_gmsh_reads(variant: str, tmp_path: Path) -> None:
    path = make("gmsh", variant, tmp_path)
    groups, expected = groups_of(read(path).source), of_gmsh(path)
    assert groups.keys() == expected.keys() == {"steel", "copper", "all of it", "wall"}
    points = read(path).source.points
    for name, (dimension, number, coordinates) in expected.items():
        assert groups[name].counts == {dimension: number}
        assert sorted(points[groups[name].points].ravel().tolist()) == coordinates


@pytest.mark.parametrize("variant", VERSIONS)
def test_a_group_inside_of_the_mesh_stays(variant: str, tmp_path: Path) -> None:
    """The copper is not moved, and the steel is mended."""
    path, target = make("gmsh", variant, tmp_path), tmp_path / "out.msh"
    document = read(path, fix="copper", regions="none")
    rows = groups_of(document.source)["copper"].points
    assert read(path).mesh.movable[rows].any()
    assert not document.mesh.movable[rows].any()
    assert document.fixed["by --fix copper"] == int(read(path, regions="none").mesh.movable[rows].sum())
    run("untangle", "-q", "--fix", "copper", path, target, code=3)
    before, after = read(path).source.points, read(target).source.points
    assert before[rows].tobytes() == after[rows].tobytes()
    assert (before != after).any()


@pytest.mark.parametrize("form", FORMATS)
def test_every_group_can_be_held(form: str, tmp_path: Path) -> None:
    """As any format tells them: its vertices that were free are held, and no others."""
    found = 0
    for variant in MODULES[form].FILES:
        path = make(form, variant, tmp_path)
        document = read(path)
        for name, group in list(groups_of(document.source).items())[:3]:
            held, free = read(path, fix=name).mesh.movable, document.mesh.movable
            belongs = np.isin(np.arange(len(free)), group.points)
            assert (held == free & ~belongs).all()
            assert sum(group.counts.values()) == 0 or len(group.points)
            found += 1
    assert found > 0 or form not in WITH_GROUPS


def test_parts_of_a_mesh_have_its_groups(tmp_path: Path) -> None:
    with gmsh_session(MshFileVersion=4.1, Binary=0, PartitionSplitMeshFiles=1) as gmsh:
        boxes(gmsh)
        gmsh.write(str(tmp_path / "whole.msh"))
        gmsh.model.mesh.partition(3)
        gmsh.write(str(tmp_path / "in.msh"))
    whole, joined = (read(str(tmp_path / name)) for name in ("whole.msh", "in_*.msh"))
    assert joined.groups() == whole.groups()
    held = read(str(tmp_path / "in_*.msh"), fix=["steel"])
    assert held.fixed == read(tmp_path / "whole.msh", fix=["steel"]).fixed


@pytest.fixture
def inp(tmp_path: Path) -> Path:
    """An Abaqus file with sets of nodes and of elements inside of the mesh, two of one name and one that is empty."""
    points, cells = shapes.block()
    ids = numbers(len(points))
    core = inner(points, cells)
    path = tmp_path / "in.inp"
    path.write_text(
        f"*NODE\n{nodes(points, ids)}*ELEMENT, TYPE=C3D4, ELSET=Solid\n{elements(cells, ids)}"
        f"*NSET, NSET=Tips\n{core[0] + 1}, {core[1] + 1}\n*NSET, NSET=Core\n{core[2] + 1}\n*ELSET, ELSET=Core\n1, 2\n"
        "*NSET, NSET=Nothing\n\n*SOLID SECTION, ELSET=Solid, MATERIAL=M\n"
    )
    return path


def inner(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Points that are on no face of one element alone."""
    faces = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
    each, count = np.unique(faces, axis=0, return_counts=True)
    return np.setdiff1d(np.arange(len(points)), each[count == 1])


def test_sets_of_abaqus_are_held(inp: Path) -> None:
    points, cells = shapes.block()
    core = inner(points, cells)
    tips, both = read(inp, fix="Tips"), read(inp, fix=("Core", "Tips"))
    free = read(inp).mesh.movable
    assert np.flatnonzero(free & ~tips.mesh.movable).tolist() == core[:2].tolist()
    expected = {*core[:3].tolist(), *(cells[:2].ravel()[free[cells[:2].ravel()]]).tolist()}
    assert set(np.flatnonzero(free & ~both.mesh.movable).tolist()) == expected
    assert both.fixed["by --fix Core"] + both.fixed["by --fix Tips"] == len(expected)
    nothing = read(inp, fix="Nothing")
    assert nothing.fixed == read(inp).fixed
    assert "--fix Nothing holds no vertex: there is none in it" in nothing.notes


def test_groups_are_listed(inp: Path) -> None:
    total = len(shapes.block()[1])
    assert run("quality", inp, code=3).stdout.decode().count("groups:") == 0
    text = run("quality", "--verbose", inp, code=3).stdout.decode()
    assert f"groups: Solid ({total} elements), Core (2 elements, 1 vertex), Tips (2 vertices)\n" in text
    told = json.loads(run("quality", "--json", inp, code=3).stdout)["groups"]
    assert {"name": "Solid", "kind": "element", "dimension": 3, "number": total} in told
    assert {"name": "Core", "kind": "vertex", "dimension": 0, "number": 1} in told
    assert {"name": "Nothing", "kind": None, "dimension": None, "number": 0} in told
    assert len(told) == 5
    assert "exclude each other" in error_line("quality", "-q", "-v", inp, code=2)


def test_words_are_those_of_the_dimension(tmp_path: Path) -> None:
    text = run("quality", "-v", make("gmsh", "groups_text_4.msh", tmp_path), code=3).stdout.decode()
    assert "wall (" in text
    assert " faces)" in text
    text = run("quality", "-v", make("gmsh", "parametric_text_4.msh", tmp_path), code=3).stdout.decode()
    assert " edges)" in text
    assert "groups: none" in run("quality", "-v", make("vtk", "meshio_42.vtk", tmp_path), code=3).stdout.decode()


@pytest.fixture
def square(tmp_path: Path) -> Path:
    """A file of gmsh with data and groups of equal names, of two dimensions, and with a name that acts on terminals."""
    points, cells = shapes.plate()
    core = np.setdiff1d(np.arange(len(points)), outline(cells))
    lines = [f"{i} 2 2 {2 + i % 2} 1 {a} {b} {c}\n" for i, (a, b, c) in enumerate(cells + 1, 3)]
    places = [f"{i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(points, 1)]
    flags = "".join(f"{i} {int(i == core[5] + 1)}\n" for i in range(1, len(points) + 1))
    at = f"{core[0] + 1} {core[1] + 1}"
    path = tmp_path / "in.msh"
    path.write_text(
        '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n5\n1 1 "weld"\n2 2 "weld"\n2 3 "hot"\n'
        '2 7 "nobody"\n1 9 "\x1b[2Jred"\n$EndPhysicalNames\n'
        f"$Nodes\n{len(points)}\n{''.join(places)}$EndNodes\n"
        f"$Elements\n{len(cells) + 2}\n1 1 2 1 1 {at}\n2 1 2 9 1 {at}\n{''.join(lines)}$EndElements\n"
        f'$NodeData\n1\n"hot"\n1\n0.0\n3\n0\n1\n{len(points)}\n{flags}$EndNodeData\n'
    )
    return path


def outline(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    edges = np.sort(np.concatenate([cells[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    each, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(each[count == 1])


def test_an_array_is_meant_before_a_group_of_its_name(square: Path) -> None:
    document = read(square, fix="hot", regions="none")
    assert "hot" in groups_of(document.source)
    assert document.mesh.movable.sum() == read(square, regions="none").mesh.movable.sum() - 1


def test_a_name_in_two_dimensions_is_one_group(square: Path) -> None:
    cells = shapes.plate()[1]
    counts = read(square).groups()
    assert counts["weld"].keys() == {2, 1}
    assert counts["weld"][2] + counts["hot"][2] == len(cells)
    assert counts["weld"][1] == 1
    assert counts["nobody"] == {2: 0}


def test_names_never_act_on_a_terminal(square: Path) -> None:
    done = run("quality", "-v", square, code=3)
    assert rb"\x1b[2Jred (1 edge)" in done.stdout
    assert b"\x1b" not in done.stdout + run("quality", "--json", square, code=3).stdout
    assert b"\x1b" not in error_line("untangle", "--fix", "\x1b[1m", square).encode()


def test_unknown_names_are_answered_by_those_that_there_are(inp: Path, square: Path) -> None:
    found = r"there is no point data, set or group named 'nope' \(found: Core, Nothing, Solid, Tips\)"
    with pytest.raises(ReadError, match=found):
        read(inp, fix=["Tips", "nope"])
    assert "found: Core, Nothing, Solid, Tips" in error_line("quality", "--fix", "Tips", "--fix", "nope", inp)
    with pytest.raises(ReadError, match=r"found: .*hot, nobody, weld"):
        read(square, fix="wel")


def test_few_of_many_names_are_told(tmp_path: Path) -> None:
    points, cells = shapes.plate()
    sets = {f"s{i:03d}": [np.array([i])] for i in range(100)}
    meshio.Mesh(points, [("triangle", cells)], cell_sets=sets).write(tmp_path / "in.inp")
    with pytest.raises(ReadError, match=r"s018, s019 and 80 more\)$"):
        read(tmp_path / "in.inp", fix="nope")


def test_no_regions_free_the_interfaces(tmp_path: Path) -> None:
    by_gmsh(boxes, tmp_path / "in.msh", MshFileVersion=2.2, Binary=0)
    held, free = read(tmp_path / "in.msh"), read(tmp_path / "in.msh", regions="none")
    between = [reason for reason in held.fixed if reason.startswith("between")]
    assert between
    assert not [reason for reason in free.fixed if reason.startswith("between")]
    assert free.source.regions == held.source.regions  # so that a conversion keeps them
    assert json.loads(run("untangle", "--json", "--dry-run", "--regions", "none", tmp_path / "in.msh", code=0).stdout)


def test_an_array_that_is_called_none_has_regions(tmp_path: Path) -> None:
    points, cells = shapes.plate()
    labels = (points[cells].mean(axis=1)[:, 0] > 1.5).astype(float)
    meshio.Mesh(points, [("triangle", cells)], cell_data={"none": [labels]}).write(tmp_path / "in.vtk")
    assert read(tmp_path / "in.vtk", regions="none").fixed["between regions of none"] > 0


def test_a_batch_holds_groups(inp: Path, tmp_path: Path) -> None:
    points, cells = shapes.block()
    done = run("batch", "--json", "--fix", "Tips", "--fix", "Core", "--output-dir", tmp_path / "out", inp, code=4)
    result = json.loads(done.stdout)
    assert result["fixed"]["by --fix Tips"] == 2
    after = read(tmp_path / "out" / "in.inp").source.points
    core = np.unique([*inner(points, cells)[:3], *cells[:2].ravel()])
    assert (after[core] == points[core]).all()
