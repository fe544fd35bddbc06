"""MOVIE.BYU files: columns, parts, what VTK reads, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_byu import FILES, file
from splicing import repaired

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.byu import parse
from meshfix_cli.meshfile.formats import sniff
from meshfix_cli.meshfile.groups import groups_of

POINTS = np.array([[0, 0, 0], [-1, 0, -1], [-1, -1, 0], [0, 1, 0.25], [0.5, -0.5, -0.25]])
FAN = file(POINTS, [[0, 1, 4], [1, 2, 4], [0, 1, 2, 3], [4, 3, 2, 1, 0]], [(1, 2), (3, 4)])


@pytest.mark.parametrize("name", FILES)
def test_points_and_polygons_are_those_that_vtk_reads(name: str, tmp_path: Path) -> None:
    io = pytest.importorskip("vtkmodules.vtkIOGeometry")
    FILES[name](tmp_path / name)
    source = parse((tmp_path / name).read_bytes())
    reader = io.vtkBYUReader()
    reader.SetGeometryFileName(str(tmp_path / name))
    reader.Update()
    data = reader.GetOutput()
    np.testing.assert_allclose(source.points, [data.GetPoint(i) for i in range(data.GetNumberOfPoints())], atol=1e-6)
    cells = []
    for i in range(data.GetNumberOfCells()):
        ids = data.GetCell(i).GetPointIds()
        cells.append([ids.GetId(k) for k in range(ids.GetNumberOfIds())])
    assert source.vertices_of("triangle", 3).tolist() == cells


def test_numbers_may_touch_one_another_and_parts_are_regions() -> None:
    assert "E+00-1" in FAN
    source = parse(FAN.encode())
    np.testing.assert_array_equal(source.points, POINTS)
    assert [(run.type, run.vertices.tolist()) for run in source.cells] == [
        ("triangle", [[0, 1, 4], [1, 2, 4]]), ("quad", [[0, 1, 2, 3]]), ("polygon", [[4, 3, 2, 1, 0]])
    ]  # fmt: skip
    assert source.regions == ("byu:part",)
    assert [labels.tolist() for labels in source.arrays.cell["byu:part"]] == [[1, 1], [2], [2]]
    assert list(groups_of(source)) == ["part 1", "part 2"]


def test_columns_stay_and_numbers_that_touched_still_can_be_told_apart(tmp_path: Path) -> None:
    FILES["sheet.byu"](tmp_path / "in.byu")
    repaired(tmp_path / "in.byu", tmp_path / "out.byu")
    before, after = ((tmp_path / name).read_text().splitlines() for name in ("in.byu", "out.byu"))
    assert [len(line) for line in before] == [len(line) for line in after]
    assert read(tmp_path / "out.byu").mesh.check()[0] == 0


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("       2       5", "       2       9", "9 points announced, and not all numbers are there"),
        ("       2       5", "       2       4", "there are more lines than announced|is not an integer"),
        ("       2       5", "       x       5", "does not begin with four counts"),
        ("       5       4      15", "       5       3      15", "there are not the 3 polygons"),
        ("      -5", "      -6", "the cell 1 names the point 6, and there is none"),
        ("2.50000E-01", "2.5x000E-01", "'2.5x000E-01' is not a number"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in FAN
    with pytest.raises(ReadError, match=words):
        parse(FAN.replace(before, after, 1).encode())


@pytest.mark.parametrize("text", ["4 2 0 0\n1 0. 0.\n", "4 2 0 0\n1 0 0\n2 1 0\n3 1 1\n4 0 1\n", "1 3 1 3\n1 1\n"])
def test_files_of_others_are_not_these(text: str) -> None:
    assert sniff(text.encode()) is None
