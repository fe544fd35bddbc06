"""UGRID files: every binary form, types of elements, parts of the surface, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_ugrid import FILES, binary, content, text

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.formats import sniff
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.ugrid import parse

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.5]])
TETRA = "4 2 0 1 0 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1.5\n1 3 2 1 2 4\n7 8\n1 2 3 4\n"
KINDS = [name.split(".")[1] for name in FILES if name.startswith("mesh")]


@pytest.mark.parametrize("variant", FILES)
def test_the_bytes_tell_the_form(variant: str, tmp_path: Path) -> None:
    FILES[variant](tmp_path / "mesh.dat")
    document = read(tmp_path / "mesh.dat")
    points, blocks, labels = content()
    single = ".b4." in variant or ".lb4." in variant or "r4." in variant
    assert document.source.points.dtype == (np.float32 if single else np.float64)
    np.testing.assert_allclose(document.source.points, points, atol=1e-6)
    np.testing.assert_array_equal(document.source.cells[1].vertices, blocks["tetra"])
    assert document.source.cells[1].ids is not None
    assert document.source.cells[1].ids[0] == 1
    groups = groups_of(document.source)
    assert list(groups) == ["surface 1", "surface 2", "surface 3"]
    assert groups["surface 2"].counts == {2: int((labels == 2).sum())}


@pytest.mark.parametrize("kind", ["text", *KINDS])
def test_all_types(kind: str, tmp_path: Path) -> None:
    points, blocks = MESHES["every solid"]()
    by_type = {key: np.concatenate([rows for name, rows in blocks if name == key]) for key, _ in blocks}
    labels = np.empty(0, dtype=np.int64)
    data = text(points, by_type, labels).encode() if kind == "text" else binary(kind, points, by_type, labels)
    (tmp_path / "in.ugrid").write_bytes(data)
    document = read(tmp_path / "in.ugrid")
    assert document.not_judged == {}
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0
    for run in document.source.cells:
        np.testing.assert_array_equal(run.vertices, by_type[run.type])


def test_quadrilaterals_have_the_last_numbers() -> None:
    points = np.array([*POINTS, [1, 1, 0.5]])
    blocks = {"triangle": np.array([[0, 1, 3]]), "quad": np.array([[0, 1, 4, 2], [0, 2, 4, 1]])}
    source = parse(text(points, blocks, np.array([5, 6, 7])).encode())
    assert [one.tolist() for one in source.arrays.cell["ugrid:ref"]] == [[5], [6, 7]]


@pytest.mark.parametrize("kind", ["b8", "lb4", "lb8l"])
def test_numbers_behind_the_elements_stay(kind: str, tmp_path: Path) -> None:
    points, blocks, labels = content()
    size = 8 if kind.endswith("l") else 4
    more = np.arange(1 + len(blocks["tetra"])).astype(f"{'<' if kind.startswith('l') else '>'}i{size}").tobytes()
    (tmp_path / "in.ugrid").write_bytes(binary(kind, points, blocks, labels) + more)
    source = read(tmp_path / "in.ugrid").source
    assert source.untold == ("numbers of elements",)
    np.testing.assert_allclose(source.points, points, atol=1e-6)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("4 2 0 1", "5 2 0 1", "a number is missing|is truncated"),
        ("4 2 0 1", "4 2 0 9", "is truncated"),
        ("4 2 0 1", "4 -2 0 1", "one of its counts is below 0"),
        ("4 2 0 1", "4 x 0 1", "'x' is not an integer"),
        ("4 2 0 1", "99999999999 2 0 1", "is truncated: 99,999,999,999 rows are announced"),
        ("1.5", "1.x5", "'1.x5' is not a number"),
        ("1 2 3 4\n", "1 2 3 9\n", "names the point 9"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in TETRA
    with pytest.raises(ReadError, match=words):
        parse(TETRA.replace(before, after, 1).encode())


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_cut_is_not_taken_for_another_form(kind: str, tmp_path: Path) -> None:
    data = binary(kind, *content())
    assert sniff(data) is not None
    (tmp_path / "in.ugrid").write_bytes(data[:-5])
    with pytest.raises(ReadError, match="its length fits no binary file with its counts"):
        read(tmp_path / "in.ugrid")
