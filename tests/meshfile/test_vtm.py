"""Blocks of VTK: joined, regions, each written back; series of one step; VTK is the oracle."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from files_pvtu import slabs
from files_vtm import by_vtk, parts, read_independently, series
from files_vtu import by_vtk as grid_by_vtk
from shapes import block
from splicing import WORD, repaired

from meshfix_cli import read
from meshfix_cli.errors import ReadError, WriteError
from meshfix_cli.meshfile.groups import groups_of


def files(path: Path) -> list[Path]:
    return [path.parent / name for name in re.findall('file="([^"]*)"', path.read_text())]


def test_blocks_are_joined_and_nothing_but_coordinates_changes(tmp_path: Path) -> None:
    path, target = by_vtk(tmp_path / "in.vtm"), tmp_path / "out.vtm"
    document, _ = repaired(path, target, regions="none")
    points, cells = block()
    assert document.mesh.topology.m == len(cells)
    assert int(document.mesh.topology.used.sum()) == len(points)
    before, others_before = read_independently(path)
    after, others_after = read_independently(target)
    np.testing.assert_equal(others_after, others_before)
    assert (before != after).any()
    assert [one.name for one in files(target)] == ["out_0.vtu", "out_1.vtu", "out_2.vtp"]
    for old, new in zip(files(path), files(target), strict=True):
        was, now = (WORD.split(one.read_bytes()) for one in (old, new))
        assert was[::2] == now[::2]
    places = [{p.tobytes() for p in read(one).source.points} for one in files(target)[:2]]
    assert places[0] & places[1]
    assert {p.tobytes() for p in read(files(target)[2]).source.points} <= places[0] | places[1]


def test_blocks_are_regions_and_have_names(tmp_path: Path) -> None:
    document = read(by_vtk(tmp_path / "in.vtm"))
    assert document.source.regions == ("vtk:block", "MaterialIDs")
    groups = groups_of(document.source)
    assert list(groups) == ["left", "right", "boundary/walls"]
    points, cells = block()
    piece = slabs(points, cells, 2)
    assert groups["left"].counts == {3: int((piece == 0).sum())}
    between = set(np.unique(cells[piece == 0])) & set(np.unique(cells[piece == 1]))
    places = {tuple(points[i]) for i in between}
    here = np.array([tuple(p) in places for p in document.source.points.tolist()])
    assert here.sum() == len(between)
    assert not document.mesh.movable[here].any()
    assert read(by_vtk(tmp_path / "in.vtm"), regions="none").mesh.movable[here].any()


def test_one_block_is_a_mesh(tmp_path: Path) -> None:
    path = by_vtk(tmp_path / "in.vtm", {"left": parts()["left"]})
    document = read(path)
    assert document.source.regions == ("MaterialIDs",)


def test_a_series_of_one_step(tmp_path: Path) -> None:
    grid_by_vtk(tmp_path / "step.vtu", "Ascii")
    path = series(tmp_path / "in.pvd", ("0.5", "step.vtu"))
    repaired(path, tmp_path / "out.pvd")
    assert files(tmp_path / "out.pvd") == [tmp_path / "out_0.vtu"]
    assert read(tmp_path / "out_0.vtu").mesh.check()[0] == 0
    with pytest.raises(ReadError, match="names 2 steps in time, and one mesh is read"):
        read(series(tmp_path / "two.pvd", ("0", "step.vtu"), ("1", "other.vtu")))
    with pytest.raises(WriteError, match=r"the blocks of a .pvd are named by a file of this kind"):
        repaired(path, tmp_path / "out.vtm")


@pytest.mark.parametrize(
    ("listed", "words"),
    [
        ("", "is not a readable vtm file: it names no files of blocks"),
        ('<DataSet index="0"/>', "is not a readable vtm file: it names no files of blocks"),
        ('<DataSet file="in.vtm"/>', "in.vtm: is a block, and not a .vtu, .vtp or .vts file"),
        ('<DataSet file="a.vti"/>', "a.vti: holds a grid .ImageData. whose points have no coordinates"),
        ('<DataSet file="none.vtu"/>', "none.vtu: No such file"),
        ('<DataSet file="a.vti"/><DataSet file="./a.vti"/>', "./a.vti: stands twice among the pieces"),
    ],
)
def test_what_is_wrong_is_named(listed: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.vti").write_text('<VTKFile type="ImageData"><ImageData/></VTKFile>')
    (tmp_path / "in.vtm").write_text(
        f'<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet>{listed}</vtkMultiBlockDataSet></VTKFile>'
    )
    with pytest.raises(ReadError, match=words):
        read(tmp_path / "in.vtm")
