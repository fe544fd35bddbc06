"""One row for each format and variant: only the coordinates that moved change.

The oracles do not use the project's readers: bytes are compared word by word, and an independent program reads both
files.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from commands import run
from places import SAMPLES
from splicing import FORMATS, MODULES, WORD, make, pieces, repaired, value, without_points

from meshfix_cli import read, write
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import reading, splice
from meshfix_cli.meshfile.formats import sniff
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.solved import turned

TABLE = [(name, variant) for name, module in MODULES.items() for variant in module.FILES]

table = pytest.mark.parametrize(("form", "variant"), TABLE, ids=[f"{form}-{variant}" for form, variant in TABLE])


def spatial(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def in_order(variant: str, *points: np.ndarray) -> list[np.ndarray]:
    """The points as they are; those of gmsh 1 and 2.2, which gmsh reads in an order of its own, are sorted."""
    return [p[np.lexsort(p.T)] for p in points] if variant.endswith(("_1.msh", "_2.msh")) else list(points)


def test_the_table_is_long_enough() -> None:
    assert len(TABLE) >= 25
    assert len({form for form, _ in TABLE}) == len(FORMATS)


@table
def test_another_program_finds_other_coordinates_and_nothing_else(form: str, variant: str, tmp_path: Path) -> None:
    path, target = make(form, variant, tmp_path), tmp_path / f"out_{variant}"
    document, points = repaired(path, target)
    assert document.is_kept_by(document.format)
    before, others_before = MODULES[form].read_independently(path)
    after, others_after = MODULES[form].read_independently(target)
    np.testing.assert_equal(others_after, others_before)
    assert others_before
    found, expected = in_order(variant, after, spatial(points))
    np.testing.assert_array_equal(found, expected)
    assert (before != after).any()


@table
def test_every_other_byte_is_the_same(form: str, variant: str, tmp_path: Path) -> None:
    path, target = make(form, variant, tmp_path), tmp_path / f"out_{variant}"
    document, points = repaired(path, target)
    moved = int((points != document.source.points).sum())
    old, new = path.read_bytes(), target.read_bytes()
    if variant in getattr(MODULES[form], "ENCODED", ()):
        assert without_points(old) == without_points(new)
        assert old != new
        return
    repeated = getattr(MODULES[form], "REPEATED", 1)
    if len(old) == len(new) and b"\0" in old:
        changed = np.frombuffer(old, np.uint8) != np.frombuffer(new, np.uint8)
        assert 0 < changed.sum() <= moved * 8 * repeated
        return
    before, after = (pieces(form, variant, data) for data in (old, new))
    pairs = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert 0 < len(pairs) <= moved * repeated
    for a, b in pairs:
        assert value(a) != value(b)


@table
def test_a_mesh_that_did_not_move_is_the_same_file(form: str, variant: str, tmp_path: Path) -> None:
    path = make(form, variant, tmp_path)
    document = read(path)
    write(document, document.mesh, tmp_path / "out")
    assert (tmp_path / "out").read_bytes() == path.read_bytes()


@table
def test_a_stream_is_recognised_by_its_first_bytes(form: str, variant: str, tmp_path: Path) -> None:
    found = sniff(make(form, variant, tmp_path).read_bytes())
    assert found is not None
    assert found.reader == form


@pytest.mark.parametrize("form", FORMATS)
def test_a_stream_works_like_a_file(form: str, tmp_path: Path) -> None:
    path = make(form, next(iter(MODULES[form].FILES)), tmp_path)
    code = 3 if read(path).not_judged else 0
    run("untangle", "-q", path, tmp_path / f"out{path.suffix}", code=code)
    streamed = run("untangle", "-q", data=path.read_bytes(), code=code)
    assert streamed.stdout == (tmp_path / f"out{path.suffix}").read_bytes()


@table
def test_the_orientation_is_mended_in_the_file(form: str, variant: str, tmp_path: Path) -> None:
    """Reverse some elements in the file by its own layout, and let --fix-orientation turn them back."""
    path = make(form, variant, tmp_path)
    if not read(path).source.oriented:
        pytest.skip("numbering is no matter of orientation in this format")
    document = read(path, fix_orientation=True)
    assert not document.mesh.topology.flipped.any()
    layout = document.source.layout
    assert layout is not None
    kind = "triangle" if document.mesh.dimension == 2 else "tetra"
    run = next(i for i, cells in enumerate(document.source.cells) if cells.type == kind and len(cells.vertices) > 2)
    some = turned(document.source.cells, {run: np.array([0, 2])})
    if form in ("gmsh", "ply") and variant.startswith(("views", "meshlab")):
        with pytest.raises(ReadError, match="has data for the corners of"):
            layout.rewritten(document.source.points, document.source.points, some)
        return
    path.write_bytes(layout.rewritten(document.source.points, document.source.points, some))
    here = read(path).reversed_cells()
    assert {i: cells.rows.tolist() for i, cells in here.items()} == {run: [0, 2]}
    assert not read(path, fix_orientation=True).mesh.topology.flipped.any()


@pytest.mark.parametrize("form", [form for form in FORMATS if hasattr(reading._module(Format(form)), "promoted")])
def test_single_precision_becomes_double(form: str, tmp_path: Path) -> None:
    paths = [make(form, variant, tmp_path) for variant in MODULES[form].FILES]
    single = [path for path in paths if read(path).source.points.dtype == np.float32]
    assert single
    for path in single:
        target = path.with_name(f"out_{path.name}")
        _, points = repaired(path, target, double=True)
        assert points.dtype == np.float64
        assert (points != points.astype(np.float32)).any()
        after, others = MODULES[form].read_independently(target)
        np.testing.assert_array_equal(after, spatial(points))
        expected = MODULES[form].read_independently(path)[1]
        if form == "medit":  # where the type is a number of its own
            assert (expected.pop("MeshVersionFormatted"), others.pop("MeshVersionFormatted")) == (["1"], ["2"])
        np.testing.assert_equal(others, expected)


@pytest.mark.parametrize("name", ["bracket_tangled.vtk", "two_materials.msh", "plate_tangled.obj"])
def test_samples(name: str, tmp_path: Path) -> None:
    document, points = repaired(SAMPLES / name, tmp_path / name)
    np.testing.assert_array_equal(read(tmp_path / name).source.points, points)
    before, after = ((folder / name).read_bytes() for folder in (SAMPLES, tmp_path))
    assert WORD.split(before)[::2] == WORD.split(after)[::2]
    changed = sum(a != b for a, b in zip(WORD.split(before)[1::2], WORD.split(after)[1::2], strict=True))
    assert changed == (points != document.source.points).sum()


@pytest.mark.parametrize("slab", [1, 3, 10**6])
@pytest.mark.parametrize("backwards", [False, True])
def test_parts_that_are_written_one_by_one_make_the_whole(
    slab: int, backwards: bool, random: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(splice, "SLAB", slab)
    original = random.random((50, 3))
    lines = [f"<{' '.join(map(repr, row))}>".encode() for row in original.tolist()]
    data = b"head" + b"".join(lines) + b"tail"
    spans = splice.pairs(np.cumsum([4, *map(len, lines)]))
    words = np.array(
        [
            [[m.start() + begin, m.end() + begin] for m in re.finditer(rb"[\d.e-]+", data[begin:end])]
            for begin, end in spans.tolist()
        ]
    )
    order = np.arange(50)[::-1] if backwards else np.arange(50)
    layout = splice.InPlace(data, splice.Places.of_text(words[order]), [])
    for share in (0.0, 0.1, 1.0):
        points = np.where(random.random((50, 3)) < share, random.random((50, 3)), original)
        expected = b"head" + b"".join(f"<{' '.join(map(repr, row))}>".encode() for row in points.tolist()) + b"tail"
        assert b"".join(layout.moved(original[order], points[order])) == expected
        assert layout.rewritten(original[order], points[order], {}) == expected
