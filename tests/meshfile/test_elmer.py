"""Meshes of Elmer: a folder or one of its files, bodies and boundaries with their names, and what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import error_line, run
from elements import MESHES
from files_elmer import FILES, read_independently
from files_medit import material, rows
from second_order import reference
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import MeshfixError, ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.elmer import parse
from meshfix_cli.meshfile.solved import turned


def made(name: str, folder: Path) -> Path:
    FILES[name](folder / name)
    return folder / name


@pytest.mark.parametrize("name", FILES)
def test_only_the_coordinates_that_moved_change(name: str, tmp_path: Path) -> None:
    path = made(name, tmp_path)
    document = read(path)
    run("untangle", "-q", path, tmp_path / "out")
    before, others = read_independently(path)
    after, others_after = read_independently(tmp_path / "out")
    assert others_after == others
    moved = (before != after).any(axis=1)
    assert moved.any()
    assert not moved[~document.mesh.movable].any()
    assert {one.name for one in (tmp_path / "out").iterdir()} == {one.name for one in path.iterdir()}
    for one in path.iterdir():
        assert one.name == "mesh.nodes" or (tmp_path / "out" / one.name).read_bytes() == one.read_bytes()
    assert read(tmp_path / "out").mesh.check()[0] == 0


@pytest.mark.parametrize("suffix", ["header", "nodes", "elements"])
def test_each_of_the_files_stands_for_the_mesh(suffix: str, tmp_path: Path) -> None:
    path = made("solid", tmp_path)
    assert read(path / f"mesh.{suffix}").mesh.topology.m == len(block()[1])
    run("untangle", "-q", path / f"mesh.{suffix}", tmp_path / f"b.{suffix}")
    assert {one.name for one in tmp_path.iterdir() if one.is_file()} == {
        "b.header", "b.nodes", "b.elements", "b.boundary", "b.names"
    }  # fmt: skip
    assert read(tmp_path / "b.header").mesh.check()[0] == 0


def test_in_place_only_the_nodes_are_replaced(tmp_path: Path) -> None:
    path = made("solid", tmp_path)
    before = {one.name: one.read_bytes() for one in path.iterdir()}
    run("untangle", "-q", path, path)
    assert [one.name for one in path.iterdir() if one.read_bytes() != before[one.name]] == ["mesh.nodes"]


def test_bodies_and_boundaries_have_their_names(tmp_path: Path) -> None:
    document = read(made("solid", tmp_path))
    labels = document.source.arrays.cell["elmer:body"][0]
    np.testing.assert_array_equal(labels, material(*block()))
    held = document.mesh.topology.interface(labels)
    assert held.any()
    assert not document.mesh.movable[held].any()
    groups = document.groups()
    assert list(groups) == ["steel", "copper", "boundary 1", "boundary 2", "wall"]
    assert groups["wall"] == groups["boundary 2"]
    fixed = read(tmp_path / "solid", fix="copper", regions="none").mesh.movable
    assert not fixed[np.unique(block()[1][labels == 2])].any()


def test_elements_of_every_type(tmp_path: Path) -> None:
    points, blocks = MESHES["every solid"]()
    types = {"tetra": 504, "pyramid": 605, "wedge": 706, "hexahedron": 808}
    listed = [[types[key], *row] for key, some in blocks for row in (some + 1).tolist()]
    (tmp_path / "m.header").write_text(f"{len(points)} {len(listed) + 1} 0\n0\n")
    (tmp_path / "m.nodes").write_text(rows([i, -1, *map(repr, p)] for i, p in enumerate(points.tolist(), 1)))
    held = [9999, 1, 520, *range(1, 21)]
    (tmp_path / "m.elements").write_text(rows([*([i, 1, *row] for i, row in enumerate(listed, 1)), held]))
    document = read(tmp_path / "m.header")
    assert document.mesh.check()[0] == 0
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.topology.m == len(listed)
    assert document.not_judged == {"tetra_of_20": 1}


# From the list of its elements: nodes behind the corners of the three that are not as VTK has them, or may seem so.
OF_ELMER = {
    715: [".5 0 0", ".5 .5 0", "0 .5 0", ".5 0 1", ".5 .5 1", "0 .5 1", "0 0 .5", "1 0 .5", "0 1 .5"],
    820: [
        ".5 0 0", "1 .5 0", ".5 1 0", "0 .5 0", "0 0 .5", "1 0 .5", "1 1 .5", "0 1 .5",
        ".5 0 1", "1 .5 1", ".5 1 1", "0 .5 1",
    ],
}  # fmt: skip
OF_ELMER[827] = [*OF_ELMER[820], ".5 0 .5", "1 .5 .5", ".5 1 .5", "0 .5 .5", ".5 .5 0", ".5 .5 1", ".5 .5 .5"]


@pytest.mark.parametrize(
    ("kind", "key"),
    [
        (203, "line3"), (306, "triangle6"), (408, "quad8"), (409, "quad9"), (510, "tetra10"), (613, "pyramid13"),
        (715, "wedge15"), (820, "hexahedron20"), (827, "hexahedron27"),
    ],
)  # fmt: skip
def test_nodes_of_second_order_come_in_the_order_of_vtk(kind: int, key: str, tmp_path: Path) -> None:
    nodes, corners = reference(key), ELEMENTS[key].shape.corners
    if kind in OF_ELMER:
        nodes = np.concatenate([nodes[:corners], [[float(x) for x in one.split()] for one in OF_ELMER[kind]]])
    (tmp_path / "m.header").write_text(f"{len(nodes)} 1 0\n0\n")
    (tmp_path / "m.nodes").write_text(rows([i, -1, *map(repr, p)] for i, p in enumerate(nodes.tolist(), 1)))
    (tmp_path / "m.elements").write_text(rows([[1, 1, kind, *range(1, len(nodes) + 1)]]))
    source = parse(b"", tmp_path / "m.header")
    assert source.cells[0].type == key
    np.testing.assert_array_equal(source.points[source.cells[0].vertices[0]], reference(key))


def test_the_orientation_is_mended_in_the_file(tmp_path: Path) -> None:
    path = made("solid", tmp_path)
    source = read(path).source
    assert source.pieces is not None
    some = turned(source.cells, {0: np.array([0, 2])})
    (path / "mesh.elements").write_bytes(source.pieces.contents(source.points, source.points, some)[1])  # type: ignore[attr-defined]
    assert read(path).mesh.topology.flipped.sum() == 2
    assert not read(path, fix_orientation=True).mesh.topology.flipped.any()


def test_what_is_wrong_is_named(tmp_path: Path) -> None:
    path = made("solid", tmp_path)
    for name in ("header", "nodes", "elements", "boundary"):
        one = path / f"mesh.{name}"
        whole = one.read_bytes()
        for cut in range(0, len(whole) - 60, len(whole) // 20 + 1):
            one.write_bytes(whole[:cut])
            with pytest.raises(MeshfixError):
                read(path)
        one.write_bytes(whole.replace(b" ", b" x ", 1))
        with pytest.raises(MeshfixError):
            read(path)
        one.write_bytes(whole)
    (path / "mesh.boundary").rename(tmp_path / "elsewhere")
    with pytest.raises(ReadError, match=r"has elements of the boundary in a \.boundary, which is not there"):
        read(path)
    (path / "mesh.elements").unlink()
    with pytest.raises(ReadError, match=r"mesh\.elements, which belongs to it, is not there"):
        read(path)
    (path / "mesh.header").unlink()
    assert "no mesh.header of Elmer" in error_line("quality", path)


def test_no_other_mesh_gets_a_part_of_the_output(tmp_path: Path) -> None:
    path = made("plane", tmp_path)
    made("solid", tmp_path)
    assert "mesh.names is there, and would belong to it" in error_line("untangle", path, tmp_path / "solid")
    assert "is not a folder, as the input is" in error_line("untangle", path, tmp_path / "m.header")
