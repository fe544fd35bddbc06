"""XDMF files that are made of other formats: what they hold, meshio finds there, and so does the reader."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from laden import TYPES, document_of, laden, members
from splicing import MODULES, make

from meshfix_cli import read, write
from meshfix_cli.meshfile import anew
from meshfix_cli.meshfile.lost import lost
from meshfix_cli.meshfile.reading import parse
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

XDMF = Format("xdmf")


CASES = [(name, kind) for name in ("every solid", "quads and triangles", "graded quads") for kind in TYPES]


@pytest.mark.parametrize(("name", "kind"), [one for one in CASES if one != ("every solid", "complete")])
def test_all_arrives(name: str, kind: str, tmp_path: Path) -> None:
    """There are no pyramids of 19 nodes."""
    document = document_of(laden(kind, name))
    _, dropped = write(document, document.mesh, tmp_path / "out.xdmf", XDMF)
    source, after = document.source, read(tmp_path / "out.xdmf").source
    assert dropped == ()
    assert after.points.tobytes() == source.points.tobytes()
    assert after.regions == ("gmsh:physical",)
    for mine, theirs in zip(source.cells, after.cells, strict=True):
        assert mine.type == theirs.type
        np.testing.assert_array_equal(mine.vertices, theirs.vertices)
    for array in ("gmsh:physical", "quality"):
        for values, others in zip(source.arrays.cell[array], after.arrays.cell[array], strict=True):
            np.testing.assert_array_equal(values, others)
    np.testing.assert_array_equal(after.arrays.point["velocity"], source.arrays.point["velocity"])
    assert members(after) == members(source)
    assert read(tmp_path / "out.xdmf").fixed == document.fixed


@pytest.mark.parametrize("name", ["every solid", "graded quads"])
def test_meshio_reads_the_same(name: str, tmp_path: Path) -> None:
    source = laden("linear", name)
    (tmp_path / "out.xdmf").write_bytes(anew.written(source, source.points, XDMF))
    mesh = meshio.read(tmp_path / "out.xdmf")
    np.testing.assert_array_equal(mesh.points, source.points)
    assert [block.type for block in mesh.cells] == [run.type for run in source.cells]
    for block, run in zip(mesh.cells, source.cells, strict=True):
        np.testing.assert_array_equal(block.data, run.vertices)
    for labels, expected in zip(mesh.cell_data["gmsh:physical"], source.arrays.cell["gmsh:physical"], strict=True):
        np.testing.assert_array_equal(labels, expected)
    for found, rows in zip(mesh.cell_data["probe"], source.arrays.cell_sets["probe"], strict=True):
        np.testing.assert_array_equal(np.flatnonzero(found), rows)
    assert {key: pair.tolist() for key, pair in mesh.field_data.items()} == {
        key: pair.tolist() for key, pair in source.arrays.groups.items()
    }


def test_vertices_and_lines_stand_among_others(tmp_path: Path) -> None:
    points = np.eye(4)[:, :3] * np.pi
    tables = {"vertex": [[3]], "line": [[0, 1], [1, 2]], "line3": [[0, 1, 2]], "tetra": [[0, 1, 2, 3]]}
    arrays = Arrays(
        groups={'a "b" <c> & ü': np.array([4, 3])}, cell={"tag": [np.full(len(rows), 4) for rows in tables.values()]}
    )
    source = Source(
        points, [Cells(key, np.array(rows)) for key, rows in tables.items()], load=lambda: arrays, regions=("tag",)
    )
    back = parse(anew.written(source, points, XDMF), XDMF)
    assert {run.type: run.vertices.tolist() for run in back.cells} == tables
    assert back.regions == ("MaterialIDs",)
    assert lost(source, back) == ()
    alone = Source(points, source.cells[1:2])
    assert parse(anew.written(alone, points, XDMF), XDMF).cells[0].vertices.tolist() == tables["line"]


@pytest.mark.parametrize(("reader", "variant"), [("abaqus", None), ("gmsh", "groups_text_4.msh"), ("exodus", None)])
def test_files_of_other_formats_become_such(reader: str, variant: str | None, tmp_path: Path) -> None:
    document = read(make(reader, variant or next(iter(MODULES[reader].FILES)), tmp_path))
    _, dropped = write(document, document.mesh, tmp_path / "out.xdmf", XDMF)
    assert not [one for one in dropped if one.startswith(("group", "point data", "cell data"))]
    before, after = document.groups(), read(tmp_path / "out.xdmf").groups()
    assert {name: after[name] for name in before} == before
    data = (tmp_path / "out.xdmf").read_bytes()
    write(document, document.mesh, tmp_path / "out.xdmf", XDMF)
    assert (tmp_path / "out.xdmf").read_bytes() == data
