"""One row for each format and variant: only the coordinates that moved change.

The oracles do not use the project's readers: bytes are compared word by word, and an independent program reads both
files.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SAMPLES
from test_cli import run

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import Document
from meshfix_cli.meshfile.formats import sniff

FORMATS = ("gmsh", "vtk", "vtu", "obj", "abaqus", "medit", "ply", "stl")
MODULES = {name: importlib.import_module(f"files_{name}") for name in FORMATS}
TABLE = [(name, variant) for name, module in MODULES.items() for variant in module.FILES]
WORD = re.compile(rb"([^\s,]+)")

table = pytest.mark.parametrize(("form", "variant"), TABLE, ids=[f"{form}-{variant}" for form, variant in TABLE])


def make(form: str, variant: str, folder: Path) -> Path:
    path = folder / variant
    makers: dict[str, Callable[[Path], None]] = MODULES[form].FILES
    makers[variant](path)
    return path


def repaired(path: Path | str, target: Path | str, **options: Any) -> tuple[Document, np.ndarray]:
    """Untangle a file; the document, and the points as the new file must have them."""
    document = read(path, **options)
    outcome = untangle(document.mesh)
    assert outcome.records[0].inverted > 0
    assert outcome.valid
    result, dropped = write(document, outcome.after, target)
    assert dropped == ()
    assert result.check()[0] == 0
    return document, document.file_points(outcome.after)


def spatial(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def in_order(variant: str, *points: np.ndarray) -> list[np.ndarray]:
    """The points as they are, but those of gmsh 2.2, which gmsh reads in an order of its own: these are sorted."""
    return [p[np.lexsort(p.T)] for p in points] if variant.endswith("_2.msh") else list(points)


def without_points(data: bytes) -> bytes:
    """A .vtu file without the arrays of its points, and without the offsets, which depend on their lengths."""
    head, _, tail = data.partition(b"<AppendedData")
    start, end = tail.find(b"_") + 1, tail.rfind(b"</AppendedData")
    points = [found.span() for found in re.finditer(rb"(?s)<Points>.*?</Points>", head)]
    assert points
    offsets = [(int(found[1]), found.start()) for found in re.finditer(rb'offset="(\d+)"', head)]
    ends = [offset for offset, _ in offsets[1:]] + [end - start]
    assert offsets == sorted(offsets)
    kept = [re.sub(rb'(?s)<Points>.*?</Points>|offset="\d+"', b"", head), tail[:start], tail[end:]]
    for (offset, at), last in zip(offsets, ends, strict=False):
        if not any(first < at < behind for first, behind in points):
            kept.append(tail[start + offset : start + last])
    return b"|".join(kept)


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
    words_before, words_after = WORD.split(old), WORD.split(new)
    assert words_before[::2] == words_after[::2]  # what stands between the words
    pairs = [(a, b) for a, b in zip(words_before[1::2], words_after[1::2], strict=True) if a != b]
    assert 0 < len(pairs) <= moved * repeated
    for a, b in pairs:
        assert float(a.replace(b"D", b"e")) != float(b)


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
    run("untangle", "-q", path, tmp_path / f"out{path.suffix}")
    streamed = run("untangle", "-q", data=path.read_bytes())
    assert streamed.stdout == (tmp_path / f"out{path.suffix}").read_bytes()


@table
def test_the_orientation_is_mended_in_the_file(form: str, variant: str, tmp_path: Path) -> None:
    """Reverse some elements in the file by its own layout, and let --fix-orientation turn them back."""
    path = make(form, variant, tmp_path)
    document = read(path, fix_orientation=True)
    assert not document.mesh.topology.flipped.any()
    layout = document.source.layout
    assert layout is not None
    kind = "triangle" if document.mesh.dimension == 2 else "tetra"
    run = next(i for i, cells in enumerate(document.source.cells) if cells.type == kind and len(cells.vertices) > 2)
    some = {run: np.array([0, 2])}
    if form in ("gmsh", "ply") and variant.startswith(("views", "meshlab")):
        with pytest.raises(ReadError, match="has data for the corners of"):
            layout.rewritten(document.source.points, document.source.points, some)
        return
    path.write_bytes(layout.rewritten(document.source.points, document.source.points, some))
    here = dict(read(path).reversed_cells())
    assert {i: rows.tolist() for i, rows in here.items()} == {run: [0, 2]}
    assert not read(path, fix_orientation=True).mesh.topology.flipped.any()


@pytest.mark.parametrize("form", ["vtk", "vtu", "ply", "medit"])
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
