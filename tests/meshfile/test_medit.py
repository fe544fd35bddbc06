"""MEDIT files: every section that holds or tells something, in the dialects of the programs that write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_medit import FILES, interior, read_independently, surface
from shapes import block, plate

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.medit.text import parse, promoted
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

SMALL = (
    b"MeshVersionFormatted 2\nDimension 2\nVertices\n5\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n.5 .25 7\n"
    b"Triangles 4\n1 2 5 1\n2 3 5 1\n3 4 5 2\n4 1 5 2\nEnd\n"
)


def parsed(data: bytes) -> Source:
    source = parse(data)
    assert source is not None
    return source


def made(name: str, folder: Path) -> bytes:
    FILES[name](folder / name)
    return (folder / name).read_bytes()


@pytest.mark.parametrize("name", FILES)
def test_points_and_cells_are_those_of_the_other_reader(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    points, rest = read_independently(tmp_path / name)
    np.testing.assert_array_equal(source.points, points[:, : source.points.shape[1]])
    assert source.points.dtype == points.dtype
    for section, kind in (("Triangles", "triangle"), ("Tetrahedra", "tetra"), ("Edges", "line")):
        runs = [run.vertices for run in source.cells if run.type == kind]
        assert len(runs) == (section in rest)
        if runs:
            rows = np.column_stack([runs[0] + 1, source.arrays.cell["medit:ref"][_index(source, kind)]])
            assert [str(len(rows)), *map(str, rows.ravel())] == rest[section]
    assert [str(ref) for ref in source.arrays.point["medit:ref"]] == rest["Vertices"]


def _index(source: Source, kind: str) -> int:
    return [run.type for run in source.cells].index(kind)


@pytest.mark.parametrize("name", FILES)
def test_truncated(name: str, tmp_path: Path) -> None:
    data = made(name, tmp_path)
    end = data.index(b"End") - (len(data) - len(data.rstrip()))
    cuts = {*range(1, end - 5, max(1, end // 60)), data.index(b"End") + 2}
    for cut in (cut for cut in cuts if not (data[cut - 1 : cut].isspace() and data[cut:].lstrip()[:1].isalpha())):
        with pytest.raises(ReadError):
            parse(data[:cut])


def test_the_word_end_may_be_missing_but_not_a_number() -> None:
    whole = SMALL[: SMALL.index(b"End")]
    assert len(parsed(whole).cells[0].vertices) == 4
    with pytest.raises(ReadError, match="is truncated"):
        parse(whole[:-1])  # the last number might have had more digits
    with pytest.raises(ReadError, match="is truncated"):
        parse(whole[:-3])
    with pytest.raises(ReadError, match="is truncated"):
        parse(whole + b"Normals\n1\n0 0")


def test_more_rows_than_announced() -> None:
    with pytest.raises(ReadError, match="Vertices has more numbers than it announces"):
        parse(SMALL.replace(b"Vertices\n5", b"Vertices\n4"))
    with pytest.raises(ReadError, match="Vertices has more numbers than it announces"):
        parse(SMALL.replace(b"Vertices\n5", b"Vertices\n6"))  # it takes the next word, and what follows this
    with pytest.raises(ReadError, match="'Triangles' is not an integer"):
        parse(SMALL.replace(b"Triangles 4\n", b"Edges 1\n1 2\nTriangles 4\n"))


@pytest.mark.parametrize("count", [b"99999999999", b"9223372036854775807", b"-1"])
def test_announced_counts_are_not_believed(count: bytes) -> None:
    for section in (b"Vertices\n5", b"Triangles 4"):
        with pytest.raises(ReadError, match="is truncated"):
            parse(SMALL.replace(section, section[:-1] + count))


def test_what_mmg_requires_is_held(tmp_path: Path) -> None:
    source = parsed(made("mmg3d.mesh", tmp_path))
    points, cells = block()
    expected = np.zeros(len(points), dtype=bool)
    expected[[0, 1, 2, 3, 4, interior(points, cells)[2]]] = True
    for facet in (*surface(cells)[:3], cells[4], np.unique(np.sort(surface(cells)[:20, :2], axis=1), axis=0)[0]):
        expected[facet] = True
    np.testing.assert_array_equal(source.held, expected)
    assert "Normals" in source.untold[0]
    assert source.regions == ("medit:ref",)


def test_required_triangles_in_the_plane() -> None:
    source = parsed(SMALL.replace(b"End", b"RequiredTriangles\n1\n2\nEnd"))
    assert source.held is not None
    assert source.held.tolist() == [False, True, True, False, True]


def test_a_mark_that_names_nothing() -> None:
    for mark in (b"RequiredTriangles 1 5", b"Corners 1 6", b"RequiredVertices 1 0", b"RequiredEdges 1 1"):
        with pytest.raises(ReadError, match="names what is not among its"):
            parse(SMALL.replace(b"End", mark + b"\nEnd"))


def test_untold() -> None:
    extra = b"# why\nMyOwn 3 1e5 nan inf\nDomain 1 2 End\n"
    source = parsed(SMALL.replace(b"Triangles", extra.replace(b"End", b"") + b"Triangles"))
    assert source.untold == ("comments", "sections MyOwn, Domain")
    assert len(source.cells[0].vertices) == 4


def test_single_precision_can_be_promoted(tmp_path: Path) -> None:
    data = made("single.mesh", tmp_path)
    wider = promoted(data)
    assert wider == data.replace(b"Formatted\n1", b"Formatted\n2")
    assert parsed(data).points.dtype == np.float32
    assert parsed(wider).points.dtype == np.float64
    np.testing.assert_array_equal(parsed(wider).points, block()[0])
    assert promoted(wider) == wider
    commented = b"#MeshVersionFormatted 1\n" + SMALL.replace(b"Formatted 2", b"Formatted 1")
    assert promoted(commented) == b"#MeshVersionFormatted 1\n" + SMALL


@pytest.mark.parametrize("name", FILES)
def test_reversed_cells_read_back(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    kind = "tetra" if any(run.type == "tetra" for run in source.cells) else "triangle"
    run, rows = _index(source, kind), np.array([0, 3, 7])
    assert source.layout is not None
    back = parsed(source.layout.rewritten(source.points, source.points, turned(source.cells, {run: rows})))
    expected = source.cells[run].vertices.copy()
    expected[rows, :2] = expected[rows, 1::-1]
    np.testing.assert_array_equal(back.cells[run].vertices, expected)
    np.testing.assert_array_equal(back.arrays.cell["medit:ref"][run], source.arrays.cell["medit:ref"][run])


def test_only_the_numbers_that_changed() -> None:
    source = parsed(SMALL)
    points = source.points.copy()
    points[4, 0] = 0.375
    assert source.layout is not None
    assert source.layout.rewritten(source.points, points, {}) == SMALL.replace(b".5 .25", b"0.375 .25")


def test_a_mark_of_byte_order() -> None:
    np.testing.assert_array_equal(parsed(b"\xef\xbb\xbf" + SMALL).points, parsed(SMALL).points)


def test_a_plane_file_has_points_of_the_plane(tmp_path: Path) -> None:
    np.testing.assert_array_equal(parsed(made("freefem.mesh", tmp_path)).points, plate()[0][:, :2].astype(np.float32))


def test_nodes_whose_order_is_not_known() -> None:
    more = b"HexahedraQ2 1 " + b"1 " * 28 + b"TetrahedraP3 1 " + b"2 " * 21 + b"End"
    assert [run.type for run in parsed(SMALL.replace(b"End", more)).cells[1:]] == ["hexahedron_of_27", "tetra_of_20"]


def test_cells_of_higher_order_and_old_names() -> None:
    more = b"EdgesP2 1 1 2 5 3\nHexaedra 1 1 2 3 4 5 1 2 3 9\nPentahedra 1 1 2 3 4 5 1 0\nQuadrilaterals 0\nEnd"
    source = parsed(SMALL.replace(b"End", more))
    assert [run.type for run in source.cells] == ["triangle", "line3", "hexahedron", "wedge", "quad"]
    assert source.cells[1].vertices.tolist() == [[0, 1, 4]]
    assert source.arrays.cell["medit:ref"][2].tolist() == [9]
    assert source.cells[4].vertices.shape == (0, 4)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (SMALL.replace(b"Formatted 2", b"Formatted 7"), "known version"),
        (SMALL.replace(b"Dimension 2", b"Dimension 4"), "its dimension is 4"),
        (SMALL.replace(b"Dimension 2", b""), "does not stand before"),
        (SMALL.replace(b"End", b"Vertices 0 End"), "2 sections of vertices"),
        (SMALL.replace(b"Vertices", b"vertices"), "no sections of vertices"),
        (SMALL.replace(b".25", b"abc"), "line 9: 'abc' is not a number"),
        (SMALL.replace(b"2 3 5 1", b"2 3 x 1"), "line 12: 'x' is not an integer"),
    ],
)
def test_malformed(data: bytes, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        parse(data)
