"""VTK's XML files of polydata: the order of cells, several pieces, strips, and faults."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from files_vtp import FILES, by_vtk, read_independently

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.vtk import vtp
from meshfix_cli.meshfile.vtk.cells import TYPES

# VTK itself confuses the data of polygons and strips where there are several pieces.
MAKERS: dict[str, Callable[[Path], None]] = {
    **FILES,
    "pieces.vtp": partial(by_vtk, mode="Ascii", pieces=3, strips=False),
}


@pytest.mark.parametrize("variant", MAKERS)
def test_points_cells_and_arrays_are_those_that_vtk_reads(variant: str, tmp_path: Path) -> None:
    MAKERS[variant](tmp_path / variant)
    source = vtp.parse((tmp_path / variant).read_bytes())
    points, others = read_independently(tmp_path / variant)
    np.testing.assert_array_equal(source.points, points)
    found = {}
    for run, numbers in zip(source.cells, source.arrays.cell["number"], strict=True):
        assert run.ids is not None
        for row, vertices in enumerate(run.vertices.tolist()):
            found[int(run.ids[row])] = (run.type, vertices, numbers[row])
    assert [found[i][0] for i in range(len(found))] == [TYPES[number][0] for number in others["types"]]
    assert [found[i][1] for i in range(len(found))] == others["cells"]
    assert [found[i][2] for i in range(len(found))] == others["cell number"].tolist()


def test_elements_are_named_by_the_numbers_that_vtk_gives_them(tmp_path: Path) -> None:
    by_vtk(tmp_path / "in.vtp", "Ascii")
    document = read(tmp_path / "in.vtp")
    assert document.ids[:3].tolist() == [4, 5, 6]  # behind two vertices and two lines
    assert document.mesh.topology.m == len(read_independently(tmp_path / "in.vtp")[1]["types"]) - 5 + 2


def test_lines_hold_their_points(tmp_path: Path) -> None:
    by_vtk(tmp_path / "in.vtp", "Ascii")
    document = read(tmp_path / "in.vtp")
    lines = [run for run in document.source.cells if run.type in ("line", "poly_line")]
    for run in lines:
        assert not document.mesh.movable[np.unique(run.vertices)].any()


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("PolyData", "ImageData", "it holds no PolyData"),
        ('NumberOfPolys="', 'NumberOfPolys="x', "the NumberOfPolys of a Piece is"),
        ('NumberOfPolys="', 'NumberOfPolys="9', "its array 'offsets' has less than"),
        ("<Polys>", "<Polys/><Bodies>", "a piece has 0 arrays for its Polys offsets"),
        ('type="Float64" Name="Points"', 'type="Int64" Name="Points"', "not three Float32, or three Float64"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str, tmp_path: Path) -> None:
    by_vtk(tmp_path / "in.vtp", "Ascii")
    text = (tmp_path / "in.vtp").read_text()
    assert before in text
    text = text.replace(before, after)
    if "Bodies" in after:
        text = text.replace("</Polys>", "</Bodies>")
    with pytest.raises(ReadError, match=words):
        vtp.parse(text.encode())
