"""What is special about .stl files."""

from __future__ import annotations

from pathlib import Path

import files_stl
import numpy as np
import pytest

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import stl
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

FACETS = [
    b"  facet normal 0 0 1\n    outer loop\n      vertex 0 0 0\n      vertex 1 0 0\n      vertex 0 1.0 0\n"
    b"    endloop\n  endfacet\n",
    b"  facet normal 0.0 0.0 1.0\n    outer loop\n      vertex 1 0 0\n      vertex 1.0e0 1 0\n"
    b"      vertex -0.0 1 -0.0\n    endloop\n  endfacet\n",
]
TEXT = b"solid two\n" + b"".join(FACETS) + b"endsolid two\n"


def parse(data: bytes) -> Source:
    source = stl.parse(data)
    assert source is not None
    return source


def rewritten(data: bytes, points: np.ndarray, facets: list[int]) -> bytes:
    source = parse(data)
    assert source.layout is not None
    return source.layout.rewritten(source.points, points, turned(source.cells, {0: np.array(facets)} if facets else {}))


def binary(corners: np.ndarray, head: bytes = b"") -> bytes:
    table = np.zeros(len(corners), dtype=files_stl.BINARY)
    table["corners"], table["attribute"] = corners, 7
    return head.ljust(80) + len(corners).to_bytes(4, "little") + table.tobytes()


def test_equal_coordinates_are_one_point() -> None:
    source = parse(TEXT)
    assert source.points.dtype == np.float64
    assert source.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert [(run.type, run.vertices.tolist()) for run in source.cells] == [("triangle", [[0, 1, 2], [1, 3, 2]])]


def test_points_are_numbered_as_they_appear(random: np.random.Generator) -> None:
    corners = random.integers(0, 4, (300, 3, 3)) - 1.5
    source = parse(binary(corners))
    known: dict[tuple[float, ...], int] = {}
    cells = [known.setdefault(tuple(corner), len(known)) for corner in corners.reshape(-1, 3).tolist()]
    assert source.points.dtype == np.float32
    assert source.points.tolist() == [list(point) for point in known]
    assert source.cells[0].vertices.ravel().tolist() == cells


def test_points_that_are_no_numbers() -> None:
    corners = np.array([[[np.nan, 0, 0], [1, 0, 0], [np.nan, 0, 0]], [[1, 0, 0], [np.inf, 0, 0], [np.nan, 0, 0]]])
    source = parse(binary(corners))
    assert source.cells[0].vertices.tolist() == [[0, 1, 0], [1, 2, 0]]
    assert rewritten(binary(corners), source.points, []) == binary(corners)


def test_a_moved_point_is_written_at_all_its_corners_with_the_normals_that_change() -> None:
    points = parse(TEXT).points.copy()
    points[2] = [0.0, 0.0, 2.0]
    after = rewritten(TEXT, points, [])
    second = after.split(b"facet ")[2].splitlines()[0]
    expected = TEXT.replace(b"vertex 0 1.0 0", b"vertex 0 0 2").replace(b"vertex -0.0 1 -0.0", b"vertex -0.0 0 2")
    expected = expected.replace(b"normal 0 0 1\n", b"normal 0 -1 0\n").replace(b"normal 0.0 0.0 1.0", second)
    assert after == expected
    normal = np.cross([0, 1, 0], [-1, 0, 2]) / np.sqrt(5)
    np.testing.assert_allclose([float(word) for word in second.split()[1:]], normal, atol=1e-15)


def test_normals_that_are_still_right_keep_their_text() -> None:
    points = parse(TEXT).points.copy()
    points[3] = [1.25, 1.5, 0.0]
    assert rewritten(TEXT, points, []) == TEXT.replace(b"vertex 1.0e0 1 0", b"vertex 1.25 1.5 0")


def test_facets_without_area_have_no_normal() -> None:
    points = parse(TEXT).points.copy()
    points[3] = [0.5, 0.5, 0.0]
    assert rewritten(TEXT, points, []).split(b"facet ")[2].startswith(b"normal 0.0 0.0 0\n")
    table = np.frombuffer(rewritten(binary(np.eye(3)[None]), np.zeros((3, 3), np.float32), [])[84:], files_stl.BINARY)
    assert not table["normal"].any()


def test_normals_that_are_no_numbers_are_replaced() -> None:
    data = TEXT.replace(b"normal 0 0 1\n", b"normal -nan(ind) -1.#IND 1\n")
    points = parse(data).points.copy()
    assert rewritten(data, points, []) == data
    points[0] = [0.25, 0.0, 0.0]
    assert rewritten(data, points, []) == TEXT.replace(b"vertex 0 0 0\n", b"vertex 0.25 0 0\n")


def test_turned_facets_have_the_other_normal() -> None:
    source = parse(TEXT)
    after = rewritten(TEXT, source.points, [1])
    assert after == TEXT.replace(FACETS[1], (
        b"  facet normal 0.0 0.0 -1\n    outer loop\n      vertex 1.0e0 1 0\n      vertex 1 0 0\n"
        b"      vertex -0.0 1 -0.0\n    endloop\n  endfacet\n"
    ))  # fmt: skip
    assert rewritten(after.replace(b" -1\n", b" 1.0\n"), parse(after).points, [1]).count(b"normal 0.0 0.0 1.0") == 1


@pytest.mark.parametrize("form", ["text", "binary"])
def test_facets_that_are_turned_and_moved_at_once(form: str) -> None:
    source = parse(TEXT)
    data = TEXT if form == "text" else binary(source.points[source.cells[0].vertices])
    points = parse(data).points.copy()
    points[1, 0] = 2.0
    after = parse(rewritten(data, points, [0]))
    corners = after.points[after.cells[0].vertices]
    np.testing.assert_array_equal(corners, points[[[1, 0, 2], [1, 3, 2]]])


def test_binary_facets_keep_their_attributes_and_the_head(random: np.random.Generator) -> None:
    corners = random.random((20, 3, 3)).astype(np.float32)
    data = binary(corners, b"solid facet")
    points = parse(data).points.copy()
    points[0] += 1.0
    after = rewritten(data, points, [3])
    before, table = (np.frombuffer(one[84:], dtype=files_stl.BINARY) for one in (data, after))
    assert after[:84] == data[:84]
    np.testing.assert_array_equal(table["attribute"], before["attribute"])
    np.testing.assert_array_equal(table["corners"][1:3], corners[1:3])
    np.testing.assert_array_equal(table["corners"][3], corners[3, [1, 0, 2]])
    np.testing.assert_array_equal(table["corners"][0], [corners[0, 0] + np.float32(1), *corners[0, 1:]])
    for row in (0, 3):
        cross = files_stl.normals_of(table["corners"][row : row + 1].astype(np.float64))
        np.testing.assert_allclose(table["normal"][row : row + 1], cross, atol=1e-6)
    assert not table["normal"][[1, 2, *range(4, 20)]].any()


def test_a_plane_mesh_keeps_its_third_coordinate(tmp_path: Path) -> None:
    files_stl.FILES["trimesh_text.stl"](tmp_path / "in.stl")
    data = (
        (tmp_path / "in.stl")
        .read_bytes()
        .replace(b" 0.0\nvertex", b" 3.25\nvertex")
        .replace(b" 0.0\nendloop", b" 3.25\nendloop")
    )
    (tmp_path / "in.stl").write_bytes(data)
    document = read(tmp_path / "in.stl")
    write(document, untangle(document.mesh).after, tmp_path / "out.stl")
    after = (tmp_path / "out.stl").read_text()
    assert after != data.decode()
    assert {line.split()[3] for line in after.splitlines() if line.startswith("vertex")} == {"3.25"}


def test_solids_are_regions_and_attributes_are_data() -> None:
    several = b"solid a\n" + FACETS[0] + b"endsolid a\nSOLID b\n" + FACETS[1].upper() + FACETS[0] + b"ENDSOLID b"
    source = parse(several)
    assert source.regions == ("stl:solid",)
    assert [runs.tolist() for runs in source.arrays.cell["stl:solid"]] == [[0, 1, 1]]
    assert (source.untold, parse(TEXT).untold, parse(TEXT.replace(b" two", b"")).untold) == (
        ("names of solids",), ("names of solids",), (),
    )  # fmt: skip
    assert parse(TEXT).regions == ()
    coloured = parse(binary(np.eye(3)[None], b"COLOR"))
    assert (coloured.untold, coloured.arrays.cell["attribute"][0].tolist()) == (("header",), [7])


def test_the_interface_of_solids_is_held(tmp_path: Path) -> None:
    files_stl.FILES["patches.stl"](tmp_path / "a.stl")
    document = read(tmp_path / "a.stl")
    assert document.fixed["between regions of stl:solid"] > 0


@pytest.mark.parametrize("variant", files_stl.FILES)
def test_truncated_files(variant: str, tmp_path: Path) -> None:
    files_stl.FILES[variant](tmp_path / variant)
    data = (tmp_path / variant).read_bytes()
    last = len(data) if b"\0" in data else data.lower().rfind(b"endsolid") + len("endsolid")
    for at in [0, 1, 79, 83, 84, 90, *range(100, last, last // 40), last - 1]:
        with pytest.raises(ReadError):
            stl.parse(data[:at])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (TEXT.replace(b"      vertex 1 0 0\n", b"", 1), "line 2: a facet begins here that has not three vertices"),
        (
            TEXT.replace(b"vertex 1.0e0 1 0\n", b"vertex 1 1 1\nvertex 1 1 2\n"),
            "line 9: a facet begins here that has not",
        ),
        (TEXT.replace(b"  endfacet\n", b"", 1), "line 2: a facet begins here"),
        (TEXT.replace(b"vertex 1.0e0 1 0", b"vertex 1.0e0 1"), "line 12: a vertex has not three coordinates"),
        (TEXT.replace(b"vertex 1.0e0 1 0", b"vertex 1,5 1,0 0,0"), "line 12: a vertex has not three coordinates"),
        (TEXT.replace(b"vertex 1.0e0 1 0", b"vertex 1.0e0 1 0 0"), "line 12: a vertex has not three coordinates"),
        (TEXT.replace(b"vertex 1.0e0 1 0", b"vertex 1.0e0 1 o"), "line 12: 'o' is not a number"),
        (TEXT.replace(b"normal 0 0 1\n", b"normal 0 0\n"), "line 2: a facet has not one normal"),
        (TEXT.replace(b"endsolid two", b"end two"), "is truncated: its last solid does not end"),
        (TEXT.removesuffix(b"endsolid two\n"), "is truncated: its last solid does not end"),
        (b"solid a\n", "is truncated: its last solid does not end"),
        (binary(np.eye(3)[None])[:-1], "is truncated: it announces 1 facet, for which 1 byte is missing"),
        (
            binary(np.eye(3)[None], b"solid")[:100],
            "is truncated: it announces 1 facet, for which 34 bytes are missing",
        ),
        (binary(np.eye(3)[None]) + b"\0", "is not a readable stl file: it is neither text nor as long as"),
        (b"\0" * 80 + b"\xff" * 4, "is truncated: it announces 4,294,967,295 facets"),
        (b"nothing", "is not a readable stl file"),
    ],
)
def test_one_clear_sentence_for_what_is_wrong(data: bytes, message: str) -> None:
    with pytest.raises(ReadError) as error:
        stl.parse(data)
    assert str(error.value).startswith(message)


def test_odd_lines_and_line_ends_do_not_matter() -> None:
    plain = parse(TEXT)
    odd = TEXT.replace(b"    outer loop\n", b"color 1 0 0\nouter loop\n\n").replace(b"two", b"vertex 1 2 3 facet")
    for data in (odd, odd.replace(b"\n", b"\r\n"), odd.replace(b"\n", b"\r"), b"\xef\xbb\xbf \n" + odd.upper()):
        np.testing.assert_array_equal(parse(data).points, plain.points)
        np.testing.assert_array_equal(parse(data).cells[0].vertices, plain.cells[0].vertices)


def test_files_without_facets() -> None:
    for data in (b"solid\nendsolid\n", bytes(84)):
        assert len(parse(data).points) == len(parse(data).cells[0].vertices) == 0


def test_a_facet_may_have_no_normal_and_a_solid_end_in_two_words() -> None:
    data = TEXT.replace(b"facet normal 0 0 1", b"facet", 1).replace(b"endsolid two", b"End Solid two")
    source = parse(data)
    points = source.points.copy()
    points[1:, 2] = 1.0
    after = rewritten(data, points, [])
    np.testing.assert_array_equal(parse(after).points, points)
    facets = [line.split() for line in after.splitlines() if line.split()[:1] == [b"facet"]]
    assert [len(words) for words in facets] == [1, 5]
    normal = np.array([float(word) for word in facets[1][2:]])
    a, b, c = points[source.cells[0].vertices[1]]
    np.testing.assert_allclose(normal, np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a)), atol=1e-15)
    assert after.endswith(b"End Solid two\n")
