"""Broken files: no traceback, no hang, no memory beyond what the file deserves, and no wrong success.

`make fuzz` runs many more examples than the tests do.
"""

from __future__ import annotations

import os
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import files_openfoam
import files_pvtp
import files_tetgen
import files_vtm
import numpy as np
import pytest
from files_pvtu import slabs, split
from files_xdmf import stored
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapes import block, plate
from splicing import FORMATS, MODULES

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import MeshfixError

# Hypothesis warns of its own account of large files, which becomes an error here and hides what it found.
pytestmark = pytest.mark.filterwarnings("ignore:Generating overly large repr")

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
        sizes = mesh.judged().judge(mesh.along_curve(mesh.points), 1)[1]
        if abs(sizes.sum()) < 1e-9 * np.abs(sizes).sum():
            return  # a vertex so far away that rounding tells which orientation is the positive one
    if document.mesh.surface is not None:
        return  # the sides of a folded surface are found anew
    if again.mesh.surface is not None and np.abs(document.mesh.points).max() > 1e30:
        return  # what lay in a plane does not where such coordinates are rounded
    inverted, smallest = again.mesh.check()
    assert inverted == result.check()[0]
    if document.basis is None:  # else the plane of a flat mesh is found anew
        assert smallest == result.check()[1]
    assert again.mesh.topology.misnumbered.sum() == document.mesh.topology.misnumbered.sum()
    fixed = ~document.mesh.movable & document.mesh.topology.used
    assert again.source.points[fixed].tobytes() == document.source.points[fixed].tobytes()


def pvtu(folder: Path) -> str:
    points, cells = plate()
    split(folder / "in.pvtu", points, cells, slabs(points, cells, 2), mode="Ascii", ids=True, ghosts=True)
    return "in.pvtu"


def pvtp(folder: Path) -> str:
    files_pvtp.split(folder / "in.pvtp")
    return "in.pvtp"


def vtm(folder: Path) -> str:
    files_vtm.by_vtk(folder / "in.vtm")
    return "in.vtm"


def xdmf(folder: Path) -> str:
    stored(folder)
    return "in.xdmf"


def tetgen(folder: Path) -> str:
    files_tetgen.tetgen(folder / "in.node")
    return "in.node"


def openfoam(folder: Path, binary: bool = False) -> str:
    points, cells = block()
    files_openfoam.write(folder, points, [("tetra", cells)], binary=binary)
    return "."


SEVERAL: dict[str, Callable[[Path], str]] = {
    "pvtu": pvtu,
    "pvtp": pvtp,
    "vtm": vtm,
    "xdmf": xdmf,
    "tetgen": tetgen,
    "openfoam": openfoam,
    "openfoam_binary": partial(openfoam, binary=True),
}


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@cache
def files_of(form: str) -> tuple[str, dict[str, bytes]]:
    with tempfile.TemporaryDirectory() as folder:
        name = SEVERAL[form](Path(folder))
        return name, contents(Path(folder))


@st.composite
def broken_files(draw: st.DrawFn, form: str) -> dict[str, bytes]:
    """One of the files of a mesh is broken; what only stands for it is as often as any other."""
    files = files_of(form)[1]
    name = draw(st.sampled_from(sorted(files)))
    return {**files, name: mutated(draw, files[name])}


@pytest.mark.parametrize("form", SEVERAL)
def test_broken_files_of_one_mesh(form: str) -> None:
    @settings(
        max_examples=EXAMPLES or 40,
        derandomize=not EXAMPLES,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(broken_files(form))
    def survives(files: dict[str, bytes]) -> None:
        with tempfile.TemporaryDirectory() as folder:
            check_files(Path(folder), files_of(form)[0], files)

    survives()


def check_files(folder: Path, name: str, files: dict[str, bytes]) -> None:
    """Read and repair; an error leaves no file, and a success is one for whoever reads the new files."""
    source, target = folder / "in", folder / "out"
    for path, data in files.items():
        (source / path).parent.mkdir(parents=True, exist_ok=True)
        (source / path).write_bytes(data)
    target.mkdir()
    start = time.monotonic()
    tracemalloc.start()
    try:
        document = read(source / name)
        document.groups()
        _, peak = tracemalloc.get_traced_memory()
        assert peak <= MEMORY * sum(map(len, files.values())) + MARGIN
        result, _ = write(document, untangle(document.mesh, sweeps=2, smooth=1).after, target / name)
    except MeshfixError as error:
        assert "\n" not in str(error)
        assert contents(source) == files
        assert not contents(target)
        return
    finally:
        tracemalloc.stop()
        assert time.monotonic() - start < SECONDS
    assert read(target / name).mesh.check() == result.check()
