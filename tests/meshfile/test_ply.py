"""What is special about .ply files."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import files_ply
import numpy as np
import pytest

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import ply
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

HEAD = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
)
VERTICES = "0 0 0\n1 0 0\n1 1.50 0\n0 1 0\n"
FACES = "3 0 1 2\n3 0 2 3\n"
TEXT = (HEAD + VERTICES + FACES).encode()
POINTS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0], [0.0, 1.0, 0.0]]


def parse(data: bytes) -> Source:
    source = ply.parse(data)
    assert source is not None
    return source


def made(path: Path, order: str, elements: dict[str, tuple[str, list[list[Any]]]], end: str = "\n") -> bytes:
    files_ply.save(path, order, [], elements, end)
    return path.read_bytes()


def elements(kind: str, faces: str = "list uchar int vertex_indices") -> dict[str, tuple[str, list[list[Any]]]]:
    vertices = [list(point) for point in POINTS]
    return {
        "vertex": (f"{kind} x, {kind} y, {kind} z", vertices),
        "face": (faces, [[[0, 1, 2]], [[0, 2, 3]]]),
    }


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize(("kind", "dtype"), [("float", "f4"), ("float32", "f4"), ("double", "f8"), ("float64", "f8")])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_types_of_coordinates(order: str, kind: str, dtype: str, end: str, tmp_path: Path) -> None:
    source = parse(made(tmp_path / "a.ply", order, elements(kind), end))
    assert source.points.dtype == np.dtype(dtype)
    assert source.points.tolist() == POINTS
    assert [(run.type, run.vertices.tolist()) for run in source.cells] == [("triangle", [[0, 1, 2], [0, 2, 3]])]


def test_rows_that_begin_with_a_line_end_behind_a_header_with_carriage_returns(tmp_path: Path) -> None:
    tables = elements("float")
    tables["vertex"] = ("uchar first, float x, float y, float z", [[10, *point] for point in POINTS])
    source = parse(made(tmp_path / "a.ply", "<", tables, "\r"))
    assert source.arrays.point["first"].tolist() == [10] * 4
    assert source.points.tolist() == POINTS


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("length", ["char", "uchar", "short", "ushort", "int", "uint", "uint8"])
@pytest.mark.parametrize("index", ["char", "uchar", "short", "ushort", "int", "uint", "int32"])
def test_types_of_lists(order: str, length: str, index: str, tmp_path: Path) -> None:
    data = made(tmp_path / "a.ply", order, elements("double", f"list {length} {index} vertex_index"))
    source = parse(data)
    assert source.cells[0].vertices.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert source.layout is not None
    after = parse(source.layout.rewritten(source.points, source.points, turned(source.cells, {0: np.array([1])})))
    assert after.cells[0].vertices.tolist() == [[0, 1, 2], [2, 0, 3]]


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_faces_of_different_counts_among_other_lists(order: str, tmp_path: Path) -> None:
    listed = "list uchar short empty, int tag, list int uint vertex_indices, list uchar float texcoord, double area"
    faces = [
        [[], 1, [0, 1, 2], [0.5], 0.5], [[1, 2], 2, [0, 1, 2, 3], [], 0.25], [[], 3, [], [1.0], 0.0],
        [[7], 4, [3, 2, 1], [0.5], 2.0], [[7], 5, [0, 1, 2, 3, 0], [0.5], 3.0], [[], 6, [1, 2], [], 4.0],
    ]  # fmt: skip
    tables = {
        **elements("float"),
        "face": (listed, faces),
        "edge": ("int vertex1, int vertex2, uchar tag", [[0, 3, 9]]),
    }
    source = parse(made(tmp_path / "a.ply", order, tables))
    assert {run.type: run.vertices.tolist() for run in source.cells[1:]} == {
        "triangle": [[0, 1, 2], [3, 2, 1]],
        "quad": [[0, 1, 2, 3]],
        "polygon": [[0, 1, 2, 3, 0]],
        "line": [[0, 3]],
    }
    assert (source.cells[0].type, source.cells[0].vertices.tolist()) == ("line", [[1, 2]])
    ids = [run.ids.tolist() for run in source.cells if run.ids is not None]
    assert ids == [[5], [0, 3], [1], [4], [0]]  # rows of the element
    assert [runs.tolist() for runs in source.arrays.cell["tag"]] == [[6], [1, 4], [2], [5], [9]]
    assert [runs.tolist() for runs in source.arrays.cell["area"]] == [[4.0], [0.5, 2.0], [0.25], [3.0], [0.0]]
    assert source.untold == ("lists empty", "lists texcoord")


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_arrays_have_the_types_of_the_file(order: str, tmp_path: Path) -> None:
    kinds = ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"]
    properties = ", ".join(f"{kind} of_{kind}" for kind in kinds)
    rows = [[*point, *(i + 3 for i, _ in enumerate(kinds))] for point in POINTS]
    tables = {**elements("double"), "vertex": (f"double x, double y, double z, {properties}", rows)}
    source = parse(made(tmp_path / "a.ply", order, tables))
    for i, kind in enumerate(kinds):
        values = source.arrays.point[f"of_{kind}"]
        assert values.dtype == np.dtype(files_ply.CODES[kind])
        assert values.tolist() == [i + 3] * 4
    assert list(source.arrays.point) == [f"of_{kind}" for kind in kinds]


def test_numbers_of_another_type_than_declared_are_read_as_they_are() -> None:
    head = HEAD.replace("property float z\n", "property float z\nproperty uchar a\nproperty int b\nproperty int c\n")
    rows = "0 0 0 1 0.5 1\n1 0 0 2 1 x\n1 1 0 300 nan 2\n0 1 0 4 -2 3\n"
    point = parse((head + rows + FACES).encode()).arrays.point
    assert point["a"].tolist() == [1, 2, 300, 4]
    np.testing.assert_array_equal(point["b"], [0.5, 1, np.nan, -2])
    assert "c" not in point  # no number at all


def test_two_coordinates() -> None:
    data = TEXT.replace(b"property float z\n", b"").replace(VERTICES.encode(), b"0 0\n1 0\n1 1\n0 1\n")
    assert parse(data).points.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]


def test_what_is_behind_the_last_element_is_kept(tmp_path: Path) -> None:
    for data in (TEXT, made(tmp_path / "a.ply", ">", elements("float"))):
        source = parse(data + b"\n more, of it\n\n")
        assert source.layout is not None
        points = source.points.copy()
        points[2, 1] = 0.25
        after = source.layout.rewritten(source.points, points, {})
        assert after.endswith(b"\n more, of it\n\n")
        assert parse(after).points.tolist() == points.tolist()


def test_only_the_words_of_moved_coordinates_change() -> None:
    source = parse(TEXT)
    points = source.points.copy()
    points[2, 1] = 0.1
    assert source.layout is not None
    after = source.layout.rewritten(source.points, points, turned(source.cells, {0: np.array([1])}))
    assert after == TEXT.replace(b"1.50", b"0.1").replace(b"3 0 2 3", b"3 2 0 3")


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("kind", ["float", "float32"])
def test_promoted(order: str, kind: str, tmp_path: Path) -> None:
    vertices = [[0.5, x + 0.1, 7, y, 0.25, z] for x, y, z in POINTS]
    tables = elements("double")
    tables["vertex"] = (f"{kind} nx, {kind} x, uchar red, {kind} y, {kind} w, {kind} z", vertices)
    single = made(tmp_path / "single.ply", order, tables)
    wide = "double" if kind == "float" else "float64"
    in_single = [[row[0], float(np.float32(row[1])), *row[2:]] if order else row for row in vertices]
    tables["vertex"] = (f"{kind} nx, {wide} x, uchar red, {wide} y, {kind} w, {wide} z", in_single)
    assert ply.promoted(single) == made(tmp_path / "double.ply", order, tables)
    assert ply.promoted(ply.promoted(single)) == ply.promoted(single)


def test_numbers_that_signal_are_promoted_without_a_warning(tmp_path: Path) -> None:
    data = made(tmp_path / "a.ply", "<", elements("float"))
    signal = struct.pack("<I", 0x7FA00000)
    assert np.isnan(parse(ply.promoted(data.replace(struct.pack("<f", 1.5), signal))).points[2, 1])


def test_double_files_are_not_promoted(tmp_path: Path) -> None:
    data = made(tmp_path / "a.ply", "<", elements("double"))
    assert ply.promoted(data) == data


@pytest.mark.parametrize("variant", files_ply.FILES)
def test_truncated_files(variant: str, tmp_path: Path) -> None:
    files_ply.FILES[variant](tmp_path / variant)
    data = (tmp_path / variant).read_bytes()
    whole = len(data) if "format ascii" not in data[:100].decode("latin-1") else data.rstrip().rfind(b" ") + 1
    for at in [0, 1, 3, 4, *range(5, whole, whole // 60), whole - 1]:
        with pytest.raises(ReadError):
            ply.parse(data[:at])


@pytest.mark.parametrize("announced", [1000, 10**6, 10**12, 10**18 - 1])
@pytest.mark.parametrize("element", ["vertex", "face", "camera"])
@pytest.mark.parametrize("order", ["", "<", ">"])
def test_announced_counts_are_not_believed(announced: int, element: str, order: str, tmp_path: Path) -> None:
    tables = elements("float")
    tables["camera"] = ("float a, list uchar int b", [[1.0, [1, 2]], [1.0, [3, 4]]])
    data = made(tmp_path / "a.ply", order, tables)
    announcement = f"element {element} {len(tables[element][1])}\n".encode()
    broken = data.replace(announcement, f"element {element} {announced}\n".encode())
    assert broken != data
    with pytest.raises(ReadError):
        ply.parse(broken)


def test_lists_that_are_longer_than_the_file(tmp_path: Path) -> None:
    data = made(tmp_path / "a.ply", "<", elements("float", "list int int vertex_indices"))
    for count in (-1, -(2**31), 4, 2**31 - 1):
        at = data.index(struct.pack("<4i", 3, 0, 2, 3))
        with pytest.raises(ReadError, match="is truncated"):
            ply.parse(data[:at] + struct.pack("<i", count) + data[at + 4 :])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ply\n", "PLY\n", "is not a readable ply file: its first line is not 'ply'"),
        ("end_header\n", "", "is truncated: its header does not end"),
        ("ascii", "binary", "line 2: 'format binary 1.0' does not belong into the header"),
        ("format ascii 1.0\n", "", "is not a readable ply file: it declares no format"),
        ("element vertex", "element point", "is not a readable ply file: it declares no vertices"),
        ("vertex 4", "vertex -4", "line 3: 'element vertex -4' does not belong"),
        ("vertex 4", "vertex 4" + "0" * 5000, "line 3: 'element vertex 4000"),
        ("element face", "element vertex", "line 7: 'element vertex 2' does not belong"),
        ("property float z", "property complex z", "line 6: 'property complex z' does not belong"),
        ("list uchar", "list float", "line 8: 'property list float int vertex_indices' does not belong"),
        ("property float x", "property float u", "is not a readable ply file: its vertices have no x, y and z"),
        ("vertex_indices", "corners", "is not a readable ply file: its element 'face' names no vertices"),
        ("1 1.50 0", "1 1,50 0", "line 12: not as many numbers as the element 'vertex' declares"),
        ("1 1.50 0", "1 1.50", "line 12: not as many numbers as the element 'vertex' declares"),
        ("1 1.50 0", "1 1.5.0 0", "line 12: '1.5.0' is not a number"),
        ("3 0 1 2", "3 0 1 x", "line 14: 'x' is not an integer"),
        ("3 0 1 2", "4 0 1 2", "line 14: not as many numbers as the element 'face' declares"),
        ("3 0 1 2", "9223372036854775807 0 1 2", "line 14: not as many numbers as the element 'face' declares"),
        ("3 0 1 2", "-1 0 1 2", "line 14: not as many numbers"),
        ("3 0 2 3\n", "3 0 2\n", "is truncated: it announces 2 rows of the element 'face'"),
        ("3 0 2 3\n", "", "is truncated: it announces 2 rows of the element 'face'"),
    ],
)
def test_one_clear_sentence_for_what_is_wrong(old: str, new: str, message: str) -> None:
    data = TEXT.decode().replace(old, new, 1)
    assert data != TEXT.decode()
    with pytest.raises(ReadError) as error:
        ply.parse(data.encode())
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("property float x", "property int x"),
        ("property float x", "property double x"),
        ("list uchar int", "list uchar float"),
        ("element face 2", "element tristrips 1\nproperty list int int vertex_indices\nelement face 1"),
    ],
)
def test_what_is_left_to_others(old: str, new: str) -> None:
    assert ply.parse(TEXT.decode().replace(old, new, 1).encode()) is None


def test_vertices_that_are_not_there_are_reported(tmp_path: Path) -> None:
    for number in (4, -1, 2**31):
        (tmp_path / "a.ply").write_bytes(TEXT.replace(b"3 0 2 3", f"3 0 2 {number}".encode()))
        with pytest.raises(Exception, match="refers to vertices"):
            read(tmp_path / "a.ply")


def test_elements_without_properties_have_no_rows() -> None:
    data = TEXT.replace(b"end_header", b"element nothing 999999999999\nend_header")
    assert parse(data).points.tolist() == POINTS
