"""Broken files: no traceback, no hang, no memory beyond what the file deserves, and no wrong success.

`make fuzz` runs many more examples than the tests do.
"""

from __future__ import annotations

import os
import tempfile
import time
import tracemalloc
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from files_pvtu import slabs, split
from files_xdmf import stored
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapes import plate
from splicing import FORMATS, MODULES

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import MeshfixError
from meshfix_cli.mesh.judged import Judged

EXAMPLES = int(os.environ.get("MESHFIX_FUZZ", "0"))  # of each format; 0: the same hundred in every run
SECONDS = 10  # of one file of some kilobytes; it takes milliseconds
MEMORY = 10  # times the file ...
MARGIN = 12 * 2**20  # ... and what any run needs: the dictionary of lzma alone takes 8 MB
NUMBERS = [b"0", b"-1", b"1", b"99", b"4294967295", b"9223372036854775807", b"1e999", b"nan", b"", b"\0", b"#", b"*"]


@cache
def bases(form: str) -> dict[str, bytes]:
    files = {}
    with tempfile.TemporaryDirectory() as folder:
        for variant, maker in MODULES[form].FILES.items():
            maker(Path(folder) / variant)
            files[variant] = (Path(folder) / variant).read_bytes()
    return files


def mutated(draw: st.DrawFn, data: bytes) -> bytes:
    """Cut, insert, overwrite or repeat; half of the time near the beginning, where the headers are."""
    end = draw(st.sampled_from([min(len(data), 400), len(data)]))
    at = draw(st.integers(0, end))
    length = draw(st.integers(0, 12))
    kind = draw(st.sampled_from(["cut", "remove", "number", "bytes", "repeat"]))
    if kind == "cut":
        return data[:at]
    if kind == "number":
        return data[:at] + draw(st.sampled_from(NUMBERS)) + data[at + length :]
    if kind == "bytes":
        return data[:at] + draw(st.binary(min_size=1, max_size=8)) + data[at + length :]
    if kind == "repeat":
        return data[: at + 20 * length] + data[at:]
    return data[:at] + data[at + length :]


@st.composite
def broken_file(draw: st.DrawFn, form: str) -> tuple[str, bytes]:
    variant = draw(st.sampled_from(sorted(bases(form))))
    data = bases(form)[variant]
    for _ in range(draw(st.integers(1, 3))):
        data = mutated(draw, data)
    return variant, data


@pytest.mark.parametrize("form", FORMATS)
def test_broken_files(form: str) -> None:
    @settings(
        max_examples=EXAMPLES or 100,
        derandomize=not EXAMPLES,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(broken_file(form))
    def survives(file: tuple[str, bytes]) -> None:
        with tempfile.TemporaryDirectory() as folder:
            check(Path(folder) / file[0], file[1])

    bases(form)
    survives()


def check(path: Path, data: bytes) -> None:
    """Read and repair; an error is one line, and a success is one for whoever reads the new file."""
    path.write_bytes(data)
    target = path.with_name(f"out_{path.name}")
    start = time.monotonic()
    tracemalloc.start()
    try:
        document = read(path)
        document.groups()
        _, peak = tracemalloc.get_traced_memory()
        assert peak <= MEMORY * len(data) + MARGIN
        outcome = untangle(document.mesh, sweeps=2, smooth=1)
        after, _ = document.first_valid_as_stored(outcome.after, outcome.before)
        result, _ = write(document, after, target)
    except MeshfixError as error:
        assert "\n" not in str(error)
        assert not target.exists()
        return
    finally:
        tracemalloc.stop()
        assert time.monotonic() - start < SECONDS
    again = read(target)
    for mesh in (document.mesh, again.mesh):
        sizes = Judged(mesh.topology.connectivity).judge(mesh.along_curve(mesh.points), 1)[1]
        if abs(sizes.sum()) < 1e-9 * np.abs(sizes).sum():
            return  # a vertex so far away that rounding tells which orientation is the positive one
    inverted, smallest = again.mesh.check()
    assert inverted == result.check()[0]
    if document.basis is None:  # else the plane of a flat mesh is found anew
        assert smallest == result.check()[1]
    assert again.mesh.topology.misnumbered.sum() == document.mesh.topology.misnumbered.sum()
    fixed = ~document.mesh.movable & document.mesh.topology.used
    assert again.source.points[fixed].tobytes() == document.source.points[fixed].tobytes()


@cache
def pieces_of_a_mesh() -> dict[str, bytes]:
    points, cells = plate()
    with tempfile.TemporaryDirectory() as folder:
        split(Path(folder) / "in.pvtu", points, cells, slabs(points, cells, 2), mode="Ascii", ids=True, ghosts=True)
        return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


@st.composite
def broken_pieces(draw: st.DrawFn) -> dict[str, bytes]:
    files = pieces_of_a_mesh()
    name = draw(st.sampled_from(["in.pvtu", "in.pvtu", "in_1.vtu"]))
    return {**files, name: mutated(draw, files[name])}


@settings(max_examples=EXAMPLES or 60, derandomize=not EXAMPLES, deadline=None, database=None)
@given(broken_pieces())
def test_broken_pieces(files: dict[str, bytes]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, data in files.items():
            (Path(folder) / name).write_bytes(data)
        try:
            document = read(Path(folder) / "in.pvtu")
            result, _ = write(document, untangle(document.mesh, sweeps=2, smooth=1).after, Path(folder) / "out.pvtu")
        except MeshfixError as error:
            assert "\n" not in str(error)
            assert {path.name for path in Path(folder).iterdir()} == files.keys()
            return
        assert read(Path(folder) / "out.pvtu").mesh.check() == result.check()


@cache
def files_of_fenics() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        stored(Path(folder))
        return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


@st.composite
def broken_files_of_fenics(draw: st.DrawFn) -> dict[str, bytes]:
    files = files_of_fenics()
    name = draw(st.sampled_from(sorted(files)))
    return {**files, name: mutated(draw, files[name])}


@settings(max_examples=EXAMPLES or 60, derandomize=not EXAMPLES, deadline=None, database=None)
@given(broken_files_of_fenics())
def test_broken_files_of_fenics(files: dict[str, bytes]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, data in files.items():
            (Path(folder) / name).write_bytes(data)
        try:
            document = read(Path(folder) / "in.xdmf")
            result, _ = write(document, untangle(document.mesh, sweeps=2, smooth=1).after, Path(folder) / "out.xdmf")
        except MeshfixError as error:
            assert "\n" not in str(error)
            assert {path.name for path in Path(folder).iterdir()} == files.keys()
            return
        assert read(Path(folder) / "out.xdmf").mesh.check() == result.check()
