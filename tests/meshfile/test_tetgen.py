"""Files of TetGen and Triangle: two files that belong together, whichever of them is named."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import run
from files_medit import material
from files_tetgen import FILES, nodes, read_independently, table
from second_order import element, is_straight
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import MeshfixError, ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.tetgen import parse

files = pytest.mark.parametrize("name", FILES)


def made(name: str, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    FILES[name](folder / name)
    return folder / name


@files
@pytest.mark.parametrize("suffix", [".node", ".ele"])
def test_only_the_coordinates_that_moved_change(name: str, suffix: str, tmp_path: Path) -> None:
    path = made(name, tmp_path)
    document = read(path)
    run("untangle", "-q", path.with_suffix(suffix), tmp_path / f"out.2{suffix}")
    before, others = read_independently(path)
    after, others_after = read_independently(tmp_path / "out.2.node")
    assert others_after == others
    moved = (before != after).any(axis=1)
    assert moved.any()
    assert not moved[~document.mesh.movable].any()
    beside = [one for one in tmp_path.iterdir() if one.name.startswith(path.stem) and one.suffix != ".node"]
    assert beside
    for one in beside:
        assert (tmp_path / f"out.2{one.suffix}").read_bytes() == one.read_bytes()
    assert read(tmp_path / f"out.2{suffix}").mesh.check()[0] == 0


@files
def test_in_place_only_the_nodes_are_replaced(name: str, tmp_path: Path) -> None:
    path = made(name, tmp_path)
    before = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    run("untangle", "-q", path, path)
    after = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    assert [one for one in before if before[one] != after[one]] == [name]
    run("untangle", "-q", path, path)
    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == after


def test_the_other_reader_finds_the_same_mesh(tmp_path: Path) -> None:
    document = read(made("zero.node", tmp_path))
    (tmp_path / "zero.node").write_text("\n".join(
        line.partition("#")[0] for line in (tmp_path / "zero.node").read_text().splitlines() if line[:1] not in "#"
    ))  # fmt: skip
    other = meshio.read(tmp_path / "zero.node", file_format="tetgen")
    np.testing.assert_array_equal(document.source.points, other.points)
    np.testing.assert_array_equal(document.source.cells[0].vertices, other.cells[0].data)


def test_regions_and_marked_faces(tmp_path: Path) -> None:
    document = read(made("tetgen.1.node", tmp_path))
    assert document.source.regions == ("tetgen:ref",)
    labels = document.source.arrays.cell["tetgen:ref"]
    assert labels[0].tolist() == material(*block()).tolist()
    assert set(labels[1].tolist()) == {1, 2}
    assert [run_.type for run_ in read(made("zero.node", tmp_path / "zero")).source.cells] == ["tetra", "triangle"]
    assert len(read(tmp_path / "zero" / "zero.node").source.cells[1].vertices) == 0


def test_the_orientation_is_mended_in_the_file(tmp_path: Path) -> None:
    path = made("tetgen.1.node", tmp_path)
    source = read(path).source
    assert source.pieces is not None
    some = turned(source.cells, {0: np.array([0, 2])})
    _, elements = source.pieces.contents(source.points, source.points, some)  # type: ignore[attr-defined]
    path.with_suffix(".ele").write_bytes(elements)
    assert read(path).mesh.topology.flipped.sum() == 2
    assert not read(path, fix_orientation=True).mesh.topology.flipped.any()
    run("untangle", "-q", "--fix-orientation", path, tmp_path / "out.node")
    assert not read(tmp_path / "out.node").mesh.topology.flipped.any()


def test_what_is_wrong_is_named(tmp_path: Path) -> None:
    path = made("tetgen.1.node", tmp_path)
    assert b"comes" not in run("untangle", "-q", data=path.read_bytes(), code=1).stdout
    for suffix in (".node", ".ele", ".face"):
        whole = path.with_suffix(suffix).read_bytes()
        for cut in range(0, len(whole) - 60, len(whole) // 20):
            path.with_suffix(suffix).write_bytes(whole[:cut])
            with pytest.raises(MeshfixError):
                read(path)
        for before, after in ((b"\n7  ", b"\n7 x "), (b"\n5  ", b"\n5 5 \n5 ")):
            assert before in whole
            path.with_suffix(suffix).write_bytes(whole.replace(before, after))
            with pytest.raises(MeshfixError):
                read(path)
        path.with_suffix(suffix).write_bytes(whole)
    path.with_suffix(".ele").rename(tmp_path / "elsewhere.ele")
    with pytest.raises(ReadError, match=r"tetgen\.1\.ele, which belongs to it, is not there"):
        read(path)


def test_no_file_of_the_input_is_replaced(tmp_path: Path) -> None:
    path = made("tetgen.1.node", tmp_path)
    message = run("untangle", "-q", path, tmp_path / "tetgen.1.vtk.node", code=0).stderr
    assert message == b""
    link = tmp_path / "other.node"
    link.symlink_to(path)
    (tmp_path / "other.ele").symlink_to(path.with_suffix(".ele"))
    (tmp_path / "third.ele").symlink_to(path.with_suffix(".ele"))
    assert b"would replace a file of the input" in run("untangle", path, tmp_path / "third.node", code=1).stderr


# By their manuals: between which corners the fifth node and those behind it, or the fourth, lie.
SECOND = {"tetra10": "23 03 01 12 13 02", "triangle6": "12 20 01"}


@pytest.mark.parametrize("key", SECOND)
def test_nodes_of_second_order_come_in_the_order_of_vtk(key: str, tmp_path: Path) -> None:
    d, corners = ELEMENTS[key].shape.dimension, ELEMENTS[key].shape.corners
    points = element(key)[:corners]
    points = np.concatenate([points, [points[[int(one) for one in word]].mean(axis=0) for word in SECOND[key].split()]])
    (tmp_path / "in.node").write_text(nodes(points, d, 1, marker=False))
    (tmp_path / "in.ele").write_text(f"1 {len(points)} 0\n{table(np.arange(len(points))[None] + 1, 1)}")
    if d == 3:
        (tmp_path / "in.face").write_text("2 1\n1 1 2 3 8 10 7 5\n2 1 2 4 9 6 7 0\n")
    source = parse(b"", tmp_path / "in.node")
    assert source.cells[0].type == key
    assert is_straight(key, source.points[source.cells[0].vertices], 1e-5)
    assert [run.vertices.tolist() for run in source.cells[1:]] == ([[[0, 1, 2]]] if d == 3 else [])
