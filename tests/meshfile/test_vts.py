"""Structured grids of VTK: their cells, in XML and legacy files, and grids without points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_vts import by_vtk, grid, legacy, read_independently
from splicing import WORD, repaired

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.vtk import vts

SHAPES = [(4, 3, 5), (3, 1, 4), (1, 4, 3), (3, 4, 1), (5, 1, 1), (2, 2, 2)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", ["in.vts", "in.vtk", "binary.vtk"])
def test_cells_are_those_that_vtk_finds(name: str, shape: Sequence[int], tmp_path: Path) -> None:
    path = tmp_path / name
    by_vtk(path, shape) if path.suffix == ".vts" else legacy(path, shape, name.startswith("binary"))
    points, others = read_independently(path)
    source = read_source(path)
    np.testing.assert_array_equal(source.points, points)
    (run,) = source.cells
    assert {ELEMENTS[run.type].vtk} == set(others["types"])
    assert run.vertices.tolist() == others["cells"]
    np.testing.assert_array_equal(source.arrays.cell["number"][0], others["cell number"])


def read_source(path: Path) -> Any:
    from meshfix_cli.meshfile.vtk import legacy as old

    return (vts if path.suffix == ".vts" else old).parse(path.read_bytes())


@pytest.mark.parametrize("shape", [(4, 3, 5), (4, 5, 1)])
def test_only_coordinates_change_in_a_legacy_file(shape: Sequence[int], tmp_path: Path) -> None:
    legacy(tmp_path / "in.vtk", shape)
    document, points = repaired(tmp_path / "in.vtk", tmp_path / "out.vtk")
    before, after = (WORD.split((tmp_path / name).read_bytes()) for name in ("in.vtk", "out.vtk"))
    changed = sum(a != b for a, b in zip(before, after, strict=True))
    assert changed == (points != document.source.points).sum()


def test_indices_may_run_either_way(tmp_path: Path) -> None:
    by_vtk(tmp_path / "in.vts", (4, 3, 5))
    text = (tmp_path / "in.vts").read_text()
    points, _ = read_independently(tmp_path / "in.vts")
    start = text.index(">", text.index('Name="Points"')) + 1
    mirrored = "\n".join(" ".join(map(repr, row)) for row in (points * [-1, 1, 1]).tolist())
    (tmp_path / "in.vts").write_text(text[:start] + mirrored + text[text.index("<", start) :])
    document = read(tmp_path / "in.vts")
    assert not document.mesh.topology.flipped.any()
    assert document.reversed_cells() == {}


def test_cells_cannot_be_turned_one_by_one(tmp_path: Path) -> None:
    from meshfix_cli.meshfile.splice import Turned

    by_vtk(tmp_path / "in.vts", (4, 3, 5))
    legacy(tmp_path / "in.vtk", (4, 3, 5))
    for name in ("in.vts", "in.vtk"):
        source = read_source(tmp_path / name)
        with pytest.raises(ReadError, match="has points in order"):
            source.layout.rewritten(source.points, source.points, {0: Turned(np.array([0]), [1, 0])})


def image(kind: str) -> Any:
    data = getattr(pytest.importorskip("vtkmodules.vtkCommonDataModel"), f"vtk{kind}")()
    data.SetDimensions(2, 3, 4)
    return data


@pytest.mark.parametrize(
    ("module", "writer", "kind", "words"),
    [
        ("XML", "XMLImageDataWriter", "ImageData", "a grid .ImageData. whose points have no coordinates"),
        ("XML", "XMLRectilinearGridWriter", "RectilinearGrid", "a grid .RectilinearGrid. whose points have no"),
        ("Legacy", "StructuredPointsWriter", "StructuredPoints", "a grid .STRUCTURED_POINTS. whose points have no"),
        ("Legacy", "RectilinearGridWriter", "RectilinearGrid", "a grid .RECTILINEAR_GRID. whose points have no"),
    ],
)
def test_grids_without_points_are_refused(module: str, writer: str, kind: str, words: str, tmp_path: Path) -> None:
    one = getattr(pytest.importorskip(f"vtkmodules.vtkIO{module}"), f"vtk{writer}")()
    path = tmp_path / f"in.{'vtk' if module == 'Legacy' else 'vtx'}"
    one.SetInputData(image(kind))
    one.SetFileName(str(path))
    assert one.Write()
    with pytest.raises(ReadError, match=words):
        read(path)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('Extent="0 3 0 2 0 4"', 'Extent="0 3 0 2 0 5"', "its array 'Points' has less than"),
        ('Extent="0 3 0 2 0 4"', 'Extent="0 3 0 2"', "the Extent of a Piece is '0 3 0 2'"),
        ('Extent="0 3 0 2 0 4"', 'Extent="0 3 0 2 4 0"', "has more than 0 numbers|no elements in it"),
        ("<Piece", '<Piece Extent="0 0 0 0 0 0"/><Piece', "a structured grid in several pieces|0 arrays"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str, tmp_path: Path) -> None:
    by_vtk(tmp_path / "in.vts", (4, 3, 5))
    text = (tmp_path / "in.vts").read_text()
    assert before in text
    (tmp_path / "in.vts").write_text(text.replace(before, after))
    with pytest.raises(ReadError, match=words):
        read(tmp_path / "in.vts")


def test_dimensions_that_do_not_fit_are_named(tmp_path: Path) -> None:
    legacy(tmp_path / "in.vtk", (4, 3, 5))
    text = (tmp_path / "in.vtk").read_bytes()
    for after in (b"DIMENSIONS 4 3 6", b"DIMENSIONS -4 -3 5", b"DIMENSIONS 4 x 5"):
        (tmp_path / "in.vtk").write_bytes(text.replace(b"DIMENSIONS 4 3 5", after))
        with pytest.raises(ReadError, match=r"do not fit the number of its points|stand along each index"):
            read(tmp_path / "in.vtk")


def test_hidden_cells_are_not_there(tmp_path: Path) -> None:
    """VTK marks what is blank as it marks ghosts: such cells are held."""
    writer = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLStructuredGridWriter()
    data = grid((4, 3, 5))
    data.BlankCell(0)
    writer.SetInputData(data)
    writer.SetFileName(str(tmp_path / "in.vts"))
    assert writer.Write()
    source = read(tmp_path / "in.vts").source
    assert source.held is not None
    assert source.held[source.cells[0].vertices[0]].all()
