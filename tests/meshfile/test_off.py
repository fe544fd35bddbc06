"""OFF files: keywords of many letters, counts where they like, colours, and faces of any size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_off import FILES, text
from shapes import plate

from meshfix_cli import read, write
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import formats
from meshfix_cli.meshfile.off import parse
from meshfix_cli.meshfile.recognise import Format

SQUARE = b"OFF\n5 4 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n1.5 0.5 0\n3 0 1 4\n3 1 2 4\n3 2 3 4\n3 3 0 4\n"


@pytest.mark.parametrize(
    "data",
    [
        SQUARE.replace(b"OFF\n5 4 0", b"OFF 5 4 0"),
        SQUARE.replace(b"OFF\n5 4 0", b"OFF5 4 0"),
        SQUARE.replace(b"5 4 0", b"5   4\t0 "),
        SQUARE.replace(b"5 4 0", b"5 4"),
        SQUARE.replace(b"OFF\n", b""),
        SQUARE.replace(b"OFF\n", b"\xef\xbb\xbf# of a mesher\n\n OFF\n\n# 3 2 1\n"),
        SQUARE.replace(b"1 1 0\n", b"1 1 0 # a corner\n\n#\n"),
        SQUARE.replace(b"0\n", b"0 255 0 0 255\n").replace(b"OFF\n5 4 0 255 0 0 255", b"COFF\n5 4 0"),
        SQUARE.replace(b" 4\n3", b" 4 0.5 0.5 0.5\n3"),
        SQUARE.replace(b"\n", b"\r\n"),
        SQUARE.replace(b"\n", b"\r"),
        SQUARE[:-1],
    ],
)
def test_dialects_hold_the_same(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "in.off").write_bytes(data)
    document = read(tmp_path / "in.off")
    np.testing.assert_array_equal(document.source.points, parse(SQUARE).points)
    np.testing.assert_array_equal(document.source.cells[0].vertices, [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    assert document.mesh.check()[0] == 1


def test_faces_have_any_number_of_vertices() -> None:
    faces = b"4 0 1 2 3\n3 0 1 4\n5 0 1 2 3 4 7 7 7\n3 1 2 4\n2 0 2\n1 4\n"
    source = parse(SQUARE.replace(b"5 4 0", b"5 6 0")[: SQUARE.index(b"3 0 1 4")] + faces)
    assert [(run.type, run.vertices.shape, run.ids.tolist()) for run in source.cells if run.ids is not None] == [
        ("quad", (1, 4), [0]), ("triangle", (1, 3), [1]), ("polygon", (1, 5), [2]), ("triangle", (1, 3), [3]),
        ("line", (1, 2), [4]), ("vertex", (1, 1), [5]),
    ]  # fmt: skip
    assert source.untold == ("colours, normals or texture coordinates",)


def test_what_another_format_would_lose_is_named(tmp_path: Path) -> None:
    FILES["coloured.off"](tmp_path / "in.off")
    document = read(tmp_path / "in.off")
    assert write(document, document.mesh, tmp_path / "out.vtk")[1] == ("colours, normals or texture coordinates",)


def test_a_skew_plane_stays_one(tmp_path: Path) -> None:
    FILES["tilted.off"](tmp_path / "in.off")
    document = read(tmp_path / "in.off")
    assert document.basis is not None
    assert document.not_judged == {"polygon": 1}


@pytest.mark.parametrize("keyword", ["OFF", "COFF", "NOFF", "CNOFF", "STOFF", "STCNOFF", "4OFF", "nOFF", "OFF BINARY"])
def test_keywords_are_recognised(keyword: str) -> None:
    assert formats.sniff(f"{keyword}\n5 4 0\n".encode()) == Format("off")
    assert formats.sniff(b"OFFICE\n") is None


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"OFF\n5 4 0\n", b"OFF BINARY\n\0\0\0\5", "is a binary file of OFF, which meshfix does not read"),
        (b"OFF", b"4OFF", "is of the kind 4OFF"),
        (b"OFF\n", b"nOFF\n2\n", "is of the kind nOFF"),
        (b"5 4 0", b"five", "has no counts"),
        (b"5 4 0", b"5 9 0", "is truncated: 9 faces announced"),
        (b"5 4 0", b"5 3 0", "line 11: there are more lines than announced"),
        (b"5 4 0", b"99999999999999999 4 0", "is truncated: 99,999,999,999,999,999 points announced"),
        (b"1 1 0\n", b"1 1\n", "line 5: there are not 3 numbers"),
        (b"1 1 0\n", b"1 x 0\n", "line 5: 'x' is not a number"),
        (b"3 0 1 4", b"4 0 1 4", "line 8: there are not 5 numbers"),
        (b"3 0 1 4", b"3 0 1 5", "the cell 0 names the point 5, and there is none"),
        (b"3 0 1 4", b"0 0 1 4", "line 8: a face has 0 vertices"),
        (b"3 3 0 4\n", b"3 3 0 4\nOFF\n1 0 0\n0 0 0\n", "holds several meshes"),
    ],
)
def test_what_is_wrong_is_named(before: bytes, after: bytes, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after))


def test_a_curved_surface_is_read(tmp_path: Path) -> None:
    points, cells = plate()
    bent = points + np.outer(np.sin(points[:, 0]), [0, 0, 1])
    (tmp_path / "in.off").write_text(text(bent, cells))
    mesh = read(tmp_path / "in.off").mesh
    assert mesh.surface is not None and mesh.dimension == 2


@pytest.mark.parametrize("name", FILES)
def test_truncated(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    data = (tmp_path / name).read_bytes().rstrip()
    end = data.rindex(b"\n")
    for cut in range(0, end, max(1, end // 60)):
        with pytest.raises(ReadError):
            parse(data[:cut])
