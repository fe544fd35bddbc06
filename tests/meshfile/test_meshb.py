"""Binary files of MEDIT: what meshio reads, marks, orders of nodes, and faults."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_medit import interior, material
from files_meshb import FILES, binary, plane, read_independently, single_by_keyword, solid, with_references
from second_order import SECOND, element
from shapes import block

from meshfix_cli import read, write
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.lagrange import kinds
from meshfix_cli.meshfile.medit import text
from meshfix_cli.meshfile.medit.binary import parse, promoted
from meshfix_cli.meshfile.splice import Turned

variants = pytest.mark.parametrize("name", FILES)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.25]])
CELLS = with_references(np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]), [1, 1, 2, 2])


def small(*sections: tuple[str, Any], **options: Any) -> bytes:
    return binary(SQUARE, [("Triangles", CELLS), *((name, np.array(rows)) for name, rows in sections)], **options)


@variants
def test_points_and_cells_are_those_that_meshio_reads(name: str, tmp_path: Path) -> None:
    import meshio

    if "_big" in name:
        pytest.skip("it reads no big-endian files")
    FILES[name](tmp_path / name)
    source, theirs = parse((tmp_path / name).read_bytes()), meshio.read(tmp_path / name)
    np.testing.assert_array_equal(source.points, theirs.points)
    assert [run.type for run in source.cells] == [one.type for one in theirs.cells]
    for run, one in zip(source.cells, theirs.cells, strict=True):
        np.testing.assert_array_equal(run.vertices, one.data)
    for mine, other in zip(source.arrays.cell["medit:ref"], theirs.cell_data["medit:ref"], strict=True):
        np.testing.assert_array_equal(mine, other)


@variants
def test_what_is_cut_is_truncated(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    data = (tmp_path / name).read_bytes()
    for end in {*np.linspace(0, len(data) - 1, 100).astype(int).tolist(), *range(len(data) - 8, len(data))}:
        with pytest.raises(ReadError):
            parse(data[:end])


def test_references_are_regions_and_what_is_required_is_held(tmp_path: Path) -> None:
    solid(tmp_path / "in.meshb", version=4, order=">")
    document = read(tmp_path / "in.meshb")
    points, cells = block()
    np.testing.assert_array_equal(document.source.arrays.cell["medit:ref"][1], material(points, cells))
    held = document.source.held
    assert held is not None
    assert held[interior(points, cells)[2]]
    assert held[document.source.cells[0].vertices[1]].all()
    assert "Ridges, NormalAtVertices, Normals" in document.source.untold[0]


def test_a_keyword_tells_the_precision(tmp_path: Path) -> None:
    single_by_keyword(tmp_path / "in.meshb")
    data = (tmp_path / "in.meshb").read_bytes()
    source = parse(data)
    assert source.points.dtype == np.float32
    np.testing.assert_array_equal(source.points, block()[0].astype(np.float32))
    assert promoted(data) == data


def test_double_precision_is_for_all_numbers_or_none(tmp_path: Path) -> None:
    solid(tmp_path / "in.meshb", version=1)
    solid(tmp_path / "expected.meshb", version=2)
    expected = read_independently(tmp_path / "expected.meshb")[1]
    (tmp_path / "out.meshb").write_bytes(promoted((tmp_path / "in.meshb").read_bytes()))
    points, others = read_independently(tmp_path / "out.meshb")
    assert others == expected
    np.testing.assert_array_equal(points, block()[0].astype(np.float32).astype(np.float64))
    unknown = small(version=1, end=False) + struct.pack("<iiii", 23, 0, 1, 0)
    with pytest.raises(ReadError, match="may hold numbers in single precision"):
        promoted(unknown)


@pytest.mark.parametrize("name", [".mesh", ".meshb"])
def test_one_becomes_the_other(name: str, tmp_path: Path) -> None:
    solid(tmp_path / "in.meshb")
    document = read(tmp_path / "in.meshb")
    write(document, document.mesh, tmp_path / "in.mesh")
    assert (tmp_path / "in.mesh").read_bytes().startswith(b"MeshVersionFormatted")
    other = read(tmp_path / "in.mesh")
    write(other, other.mesh, tmp_path / f"out{name}")
    back = read(tmp_path / f"out{name}")
    assert back.format.reader == {".mesh": "medit", ".meshb": "meshb"}[name]
    np.testing.assert_array_equal(back.source.points, document.source.points)
    np.testing.assert_array_equal(back.source.vertices_of("tetra", 4), document.source.vertices_of("tetra", 4))


NAMES = {
    "line3": ("EdgesP2", 25), "triangle6": ("TrianglesP2", 24), "quad9": ("QuadrilateralsQ2", 27),
    "tetra10": ("TetrahedraP2", 30), "wedge18": ("PrismsP2", 86), "pyramid14": ("PyramidsP2", 87),
    "hexahedron27": ("HexahedraQ2", 33),
}  # fmt: skip


@pytest.mark.parametrize("key", [key for key in NAMES if key in SECOND])
def test_nodes_stand_in_the_order_that_the_file_gives(key: str) -> None:
    """Lines, triangles and tetrahedra by barycentric coordinates, others along the axes."""
    shape, nodes = ELEMENTS[key].shape, element(key)
    rank = np.random.default_rng(3).permutation(len(nodes))
    places = np.array(kinds()[key].places())[rank]
    if shape.name in ("triangle", "tetrahedron"):
        d = shape.dimension
        places = np.column_stack([2 - places[:, :d].sum(axis=1), places[:, :d]])
    elif shape.name == "wedge":
        places = np.column_stack([2 - places[:, :2].sum(axis=1), places])
    name = NAMES[key][0]
    rows = " ".join(map(str, range(1, len(nodes) + 1)))
    lines = [
        "MeshVersionFormatted 2", "Dimension 3", f"Vertices {len(nodes)}",
        *(" ".join(map(repr, row)) + " 0" for row in nodes[rank].tolist()), f"{name} 1", f"{rows} 0",
        f"{name}Ordering {len(nodes)}", *(" ".join(map(str, row)) for row in places.tolist()), "End", "",
    ]  # fmt: skip
    source = text.parse("\n".join(lines).encode())
    (run,) = source.cells
    assert run.type == key
    np.testing.assert_array_equal(rank[run.vertices[0]], np.arange(len(nodes)))
    assert source.layout is not None
    order = np.random.default_rng(5).permutation(len(nodes)).tolist()
    turned = source.layout.rewritten(source.points, source.points, {0: Turned(np.array([0]), order)})
    np.testing.assert_array_equal(text.parse(turned).cells[0].vertices, run.vertices[:, order])


def test_nodes_elsewhere_are_held() -> None:
    corners = np.arange(10) + 1
    where = np.array([[2, 0, 0, 0]] * 10)
    sections = [("TetrahedraP2", np.array([[*corners, 0]])), ("TetrahedraP2Ordering", where)]
    source = parse(binary(np.zeros((10, 3)), sections))
    assert [run.type for run in source.cells] == ["tetra_of_10"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (small(version=2)[:4] + b"\7\0\0\0" + small()[8:], "its version is 7"),
        (b"\2\0\0\0" + small()[4:], "does not begin with the number 1"),
        (small()[:16] + b"\4\0\0\0" + small()[20:], "its dimension is 4"),
        (small()[:24] + b"\1\0\0\0" + small()[28:], "a keyword .4. ends at the byte 1"),
        (small()[:28] + b"\6\0\0\0" + small()[32:], "Vertices announces 6 rows"),
        (small()[:28] + b"\xff\xff\xff\xff" + small()[32:], "Vertices announces -1 rows"),
        (small(("RequiredTriangles", [[9]])), "RequiredTriangles names what is not among its Triangles"),
        (small(("FloatingPointPrecision", [[16]])), "its numbers have 16 bits"),
        (small(("TrianglesP2", [[1, 2, 3, 4, 5, 5, 0]]), ("BezierBasis", [[1]])), "control points of Bezier's"),
    ],
)
def test_what_is_wrong_is_named(data: bytes, words: str) -> None:
    with pytest.raises(ReadError, match=words):
        parse(data)


def test_a_plane_file_has_points_of_the_plane(tmp_path: Path) -> None:
    plane(tmp_path / "in.meshb")
    assert parse((tmp_path / "in.meshb").read_bytes()).points.shape[1] == 2
