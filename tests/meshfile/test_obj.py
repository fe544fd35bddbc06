"""What is special about .obj files."""

from __future__ import annotations

import re
from pathlib import Path

import files_obj
import numpy as np
import pytest

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import obj
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

VERTICES = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def parse(data: bytes) -> Source:
    source = obj.parse(data)
    assert source is not None
    return source


def cells(data: bytes) -> dict[str, list[list[int]]]:
    return {run.type: run.vertices.tolist() for run in parse(data).cells}


def test_negative_numbers_count_from_where_they_stand() -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 1 1 0\nf -3/1 -1/2 -2/-1\nf 1 2 4\n"
    assert cells(data) == {"triangle": [[0, 1, 2], [1, 3, 2], [0, 1, 3]]}


@pytest.mark.parametrize("corner", ["{}", "{}/1", "{}/1/1", "{}//1"])
def test_forms_of_corners(corner: str) -> None:
    face = "f " + " ".join(corner.format(i) for i in (1, 2, 3))
    assert cells(VERTICES + face.encode()) == {"triangle": [[0, 1, 2]]}


def test_elements_of_all_kinds_in_runs() -> None:
    data = VERTICES + b"f 1 2 3 4\np 1 2\nf 1 2 3\nl 1 2 3\nf 1 2 3 4 1 2\nl 3 4\nf 3 4 1\np 4"
    source = parse(data)
    assert [(run.type, run.vertices.tolist()) for run in source.cells] == [
        ("triangle", [[0, 1, 2], [2, 3, 0]]),
        ("quad", [[0, 1, 2, 3]]),
        ("polygon", [[0, 1, 2, 3, 0, 1]]),
        ("line", [[2, 3]]),
        ("polyline", [[0, 1, 2]]),
        ("vertex", [[3]]),
        ("vertex", [[0], [1]]),
    ]
    triangles = source.cells[0]
    assert triangles.ids is not None
    assert triangles.ids.tolist() == [1, 3]  # among the faces of the file


def test_faces_of_many_corners() -> None:
    for count in (3, 4, 5, 8, 9, 10, 33, 100):
        numbers = [i % 4 for i in range(count)]
        data = VERTICES + b"f " + " ".join(str(i + 1) for i in numbers).encode() + b" # 1 2 3\nf 1 2 3\n"
        assert numbers in next(run.vertices.tolist() for run in parse(data).cells if run.vertices.shape[1] == count)


def test_vertices_of_polygons_lines_and_points_are_held(tmp_path: Path) -> None:
    """Two interior vertices; what else names one of them holds it."""
    ring = [(np.cos(t), np.sin(t)) for t in np.arange(6) * np.pi / 3]
    lines = [f"v {x} {y} 0" for x, y in [*ring, (0.3, 0.0), (-0.3, 0.1)]]
    faces = ["f 7 8 2", "f 7 2 1", "f 7 1 6", "f 7 6 8", "f 8 6 5", "f 8 5 4", "f 8 4 3", "f 8 3 2"]
    for more, free in (("", 2), ("p 7", 1), ("l 7 1", 1), ("f 7 1 2 3 8", 0), ("p 1", 2)):
        path = tmp_path / "mesh.obj"
        path.write_text("\n".join([*lines, *faces, more]))
        assert read(path).mesh.movable.sum() == free


def test_comments_tabs_blanks_and_line_ends_do_not_matter() -> None:
    plain = VERTICES + b"f 1 2 3\nf 1 3 4\n"
    odd = b"#\n\t v\t0 0 0 # f 1 2 3\n\nv 1 0 0\t\nv 1 1 0 #\nv 0 1 0\n  f\t1  2 3 # 4\n#f 1 2 3\nf 1/1/1 3//2 4/4 "
    for data in (odd, odd.replace(b"\n", b"\r\n"), odd.replace(b"\n", b"\r"), b"\xef\xbb\xbf" + plain):
        np.testing.assert_array_equal(parse(data).points, parse(plain).points)
        assert cells(data) == cells(plain) == {"triangle": [[0, 1, 2], [0, 2, 3]]}


def test_only_the_words_of_moved_coordinates_change() -> None:
    data = b"v\t1.0  2.50 0 0.5 0.25 1\r\nv 0 0 0\r\nv 1e0 1 0 # 1e0\r\nf 1 2 3"
    source = parse(data)
    moved = source.points.copy()
    moved[0, 1], moved[2, 0] = 0.1, -1e-20
    assert source.layout is not None
    assert source.layout.rewritten(source.points, moved, {}) == (
        b"v\t1.0  0.1 0 0.5 0.25 1\r\nv 0 0 0\r\nv -1e-20 1 0 # 1e0\r\nf 1 2 3"
    )


def test_reversed_faces_take_textures_and_normals_with_them() -> None:
    source = parse(VERTICES + b"f 1/10/7  2/20/8 3/30/9\nf -1 -2 -3\nf 1//1 3//1 4//1 # b\n")
    assert source.layout is not None
    after = source.layout.rewritten(source.points, source.points, turned(source.cells, {0: np.array([0, 2])}))
    assert after == VERTICES + b"f 2/20/8  1/10/7 3/30/9\nf -1 -2 -3\nf 3//1 1//1 4//1 # b\n"
    assert cells(after) == {"triangle": [[1, 0, 2], [3, 2, 1], [2, 0, 3]]}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (b"f 0 1 2\n", "line 5: there is no vertex 0; the file has 4"),
        (b"f 1 2 3\nf 1 2 5\n", "line 6: there is no vertex 5; the file has 4"),
        (b"f -5 1 2\n", "line 5: there is no vertex -5"),
        (b"f 1 2 -99999999999999999999\n", "line 5: '-99999999999999999999' is not an integer"),
        (b"f 1 2 9223372036854775807\n", "line 5: there is no vertex 9223372036854775807"),
        (b"l 1 -9223372036854775808\n", "line 5: there is no vertex -9223372036854775808"),
        (b"f 1 2", "line 5: a face of 2 vertices"),
        (b"f", "line 5: a face of 0 vertices"),
        (b"f 1 # 2 3", "line 5: a face of 1 vertex"),
        (b"l 1\n", "line 5: a line of 1 vertex"),
        (b"f 1 2 x\n", "line 5: 'x' is not an integer"),
        (b"f 1 2.5 3\n", "line 5: '2.5' is not an integer"),
        (b"v 1 2\n", "line 5: a vertex of less than three coordinates"),
        (b"v", "line 5: a vertex of less than three coordinates"),
        (b"v 1 2 # 3\n", "line 5: a vertex of less than three coordinates"),
        (b"v 1 2 three\n", "line 5: 'three' is not a number"),
        (b"v 0,5 1,5 0,0\n", "line 5: there is a comma between the numbers"),
    ],
)
def test_one_clear_sentence_for_what_is_wrong(more: bytes, message: str) -> None:
    with pytest.raises(ReadError) as error:
        obj.parse(VERTICES + more)
    assert str(error.value).startswith(message)


def test_a_file_without_vertices_is_none() -> None:
    for data in (b"", b"\n", b"# v 1 2 3\n", b"\0\xff" * 50, b"vt 1 2 3\nf 1 2 3\n"):
        with pytest.raises(ReadError, match="is not a readable obj file: it has no vertices"):
            obj.parse(data)


def test_commas_in_names_and_comments_are_no_numbers() -> None:
    data = b"# a, b\ng left, right\n" + VERTICES + b"f 1 2 3 # a, b\n"
    assert cells(data) == {"triangle": [[0, 1, 2]]}


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b" \n"])
def test_lines_may_be_continued_and_comments_not(end: bytes) -> None:
    data = b"# from C:\\models\\\n" + VERTICES + b"f 1 2 \\" + end + b"3\n"
    assert cells(data) == {"triangle": [[0, 1, 2]]}
    source = parse(data)
    assert source.layout is not None
    assert source.layout.rewritten(source.points, source.points, {}) == data
    file = source.layout.rewritten(source.points, source.points, turned(source.cells, {0: np.array([0])}))
    assert file == data.replace(b"f 1 2", b"f 2 1")


def test_materials_are_regions() -> None:
    faces = b"f 1 2 3\nusemtl steel # a\nf 1 2 3\nusemtl copper\nf 1 2 3\nusemtl steel\nf 1 2 3\n"
    source = parse(VERTICES + faces)
    assert source.regions == ("obj:material",)
    labels = source.arrays.cell["obj:material"][0].tolist()
    assert labels[1] == labels[3]
    assert len({*labels[:3]}) == 3
    assert parse(VERTICES + b"f 1 2 3\n").regions == ()


@pytest.mark.parametrize("variant", files_obj.FILES)
def test_truncated_within_a_line(variant: str, tmp_path: Path) -> None:
    """The format announces nothing, so a file may end between any two lines; half a line is found."""
    files_obj.FILES[variant](tmp_path / variant)
    data = (tmp_path / variant).read_bytes()
    faces = [match.end() - 2 for match in re.finditer(rb"(?m)^\s*f ", data)]
    for at in faces[:: max(1, len(faces) // 20)]:
        second = data.index(b" ", at + 2)
        with pytest.raises(ReadError):
            obj.parse(data[:second])


def test_what_no_other_format_would_hold_is_named() -> None:
    assert parse(VERTICES).untold == ()
    assert parse(VERTICES + b"v 1 2 3 # 4\n").untold == ("comments",)
    everything = b"mtllib a\no a\ns 1\nvt 1 1\nvn 1 0 0\nv 0 0 0 0.5 0.5 0.5\n#\n"
    assert parse(VERTICES + everything).untold == (
        "comments", "objects and groups", "materials", "smoothing groups", "texture coordinates", "normals",
        "colours or weights of vertices",
    )  # fmt: skip


def test_vertices_of_a_plane_mesh_may_have_two_coordinates(tmp_path: Path) -> None:
    data = b"v 0 0\nv 1 0 # 2\nv 1 1\nv 0 1\nv 1.5 0.5\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
    source = parse(data)
    assert source.points.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1], [1.5, 0.5]]
    (tmp_path / "in.obj").write_bytes(data)
    document = read(tmp_path / "in.obj")
    write(document, untangle(document.mesh).after, tmp_path / "out.obj")
    before, after = data.splitlines(), (tmp_path / "out.obj").read_bytes().splitlines()
    assert [i for i, line in enumerate(before) if line != after[i]] == [4]
    assert len(after[4].split()) == 3
