"""meshio behind a wall: what it prints is swallowed, what it raises becomes one sentence."""

from __future__ import annotations

import contextlib
import errno
import gc
import io
import os
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from datetime import datetime
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import MeshfixError, ReadError, WriteError, together
from meshfix_cli.mesh.elements import ELEMENTS, dimension_of, words
from meshfix_cli.meshfile import foreign, formats, med
from meshfix_cli.meshfile.plainly import plainly
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.solved import solved_runs
from meshfix_cli.meshfile.source import Arrays, Cells, Source, regions_among

# Of types that some of its writers know meshio has no dimension, and takes no cells of them.
for _element in ELEMENTS.values():
    if _element.between:
        meshio._mesh.topological_dimension.setdefault(_element.key, _element.shape.dimension)
# Cells that meshio knows, and those that most formats do; others are left out of what it writes.
_KNOWN = frozenset(meshio._mesh.topological_dimension)
_COMMON = frozenset(key for key, element in ELEMENTS.items() if element.linear and element.shape.corners > 1) & _KNOWN
_OF_THE_DEVICE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_MATERIALS = {"meshb": "medit:ref"}
# Which module's clock a writer asks for a remark: with that the same mesh would not have the same bytes.
_CLOCKS = {
    "flac3d": ("meshio.flac3d._flac3d", "time"),
    "h5m": ("meshio.h5m._h5m", "datetime"),
}
_NOW = SimpleNamespace(now=lambda: datetime(1970, 1, 1))
_STILL = SimpleNamespace(ctime=lambda: "", datetime=_NOW, now=_NOW.now)  # for a module, or for a class in it
_ORDERS = {"med": med.ORDER}  # which of the format's nodes stands where ours do


def read(data: bytes, form: Format, path: Path | None = None) -> Source:
    """Read a file, or, without a path, what came from a stream: meshio wants a file on a disk."""
    if path is None:
        with tempfile.TemporaryDirectory(prefix="meshfix-") as folder:
            path = Path(folder) / "stream"
            path.write_bytes(data)
            return read(data, form, path)
    with _sentences(ReadError, f"is not a readable {form.name} file", path):
        _refuse(foreign.misread(data, form))
        _refuse(_several_zones(path) if form.name == "cgns" else None)
        mesh = meshio.read(path, file_format=form.reader)
        return replace(source_of(mesh), data=data)


def write(path: Path, source: Source, points: NDArray[np.floating[Any]], form: Format) -> None:
    """Write as much of a source, with other points (n, d), as the format takes; WriteError where that is nothing."""
    solved = {source.cells[i].type for i in solved_runs(source.cells)}
    attempts = [(_KNOWN, source.arrays), (_COMMON | solved, source.arrays), (solved, source.arrays), (solved, Arrays())]
    if form.name in formats.DRAWINGS and points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    for types, arrays in attempts:
        kept = [i for i, run in enumerate(source.cells) if run.type in types and len(run.vertices)]
        try:
            with (
                _sentences(WriteError, f"cannot be written as {form.name}", path, _failing(types, points)),
                _clock_stopped(form),
            ):
                _write(path, _mesh(source, points, arrays, kept, form), form)
            break
        except WriteError as error:
            last = str(error)
        gc.collect()  # what failed holds on to a file that a writer left open
    else:
        raise WriteError(last)
    if len(list(path.parent.iterdir())) > 1:
        raise WriteError(f"cannot be written as {form.name}: it takes more than one file")


def _write(path: Path, mesh: meshio.Mesh, form: Format) -> None:
    if form.name == "meshb":  # the name of the file tells meshio that it is binary
        there = path.with_name("binary.meshb")
        meshio.write(there, mesh, "medit")
        there.replace(path)
    else:
        meshio.write(path, mesh, form.name, **formats.options(form))


@contextlib.contextmanager
def _clock_stopped(form: Format) -> Iterator[None]:
    """Let a writer find the same time whenever it is called."""
    if form.name not in _CLOCKS:
        yield
        return
    name, clock = _CLOCKS[form.name]
    module = import_module(name)
    real = getattr(module, clock)
    setattr(module, clock, _STILL)
    try:
        yield
    finally:
        setattr(module, clock, real)


def _failing(types: Iterable[str], points: NDArray[np.floating[Any]]) -> str:
    """Say what a writer does not take that fails on no more than some types of cells."""
    plural = together(sorted(words(key)[1] for key in types) or ["no cells"])
    plane = max(map(dimension_of, types), default=0) < points.shape[1]
    return f"meshio's writer fails on {plural}{' whose points have three coordinates' if plane else ''}"


def _several_zones(path: Path) -> str | None:
    """Say that a file of CGNS has several zones, of which meshio reads the first."""
    import h5py

    with h5py.File(path) as file:
        groups = [group for base in file.values() if isinstance(base, h5py.Group) for group in base.values()]
        zones = sum(isinstance(group, h5py.Group) and "GridCoordinates" in group for group in groups)
    return "holds several zones, and one mesh is read: give each a file of its own" if zones > 1 else None


def _refuse(why: str | None) -> None:
    if why:
        raise ReadError(why)


def _mesh(source: Source, points: NDArray[np.floating[Any]], arrays: Arrays, kept: list[int], form: Format) -> Any:
    """The kept runs of cells; what tells materials apart goes where the format has it."""
    region = next((name for name in source.regions if name in arrays.cell), None)
    material = _MATERIALS.get(form.reader)

    def name(text: str) -> str:
        if material and text in (region, material):  # one array takes the place
            return material if text == region or region is None else f"{text} of the input"
        return text

    cell = {name(key): [runs[i] for i in kept] for key, runs in arrays.cell.items()}
    if form.reader == "meshb":  # any integers would be taken for references
        cell = {key: runs for key, runs in cell.items() if key == material}
    return meshio.Mesh(
        points,
        [(source.cells[i].type, _in_order_of(form, source.cells[i])) for i in kept],
        point_data=dict(arrays.point),
        cell_data=cell,
        # The numbers of sets of groups are not those of the groups.
        field_data={} if region == "gmsh:physical_set" else dict(arrays.groups),
    )


def _in_order_of(form: Format, run: Cells) -> Any:
    """Return the vertices of cells so that meshio writes them in the order of the format."""
    order = _ORDERS.get(form.reader, {}).get(run.type)
    return run.vertices if order is None else run.vertices[:, np.argsort(order)]


def source_of(mesh: Any) -> Source:
    """Return what a meshio.Mesh holds."""
    points = _native(mesh.points)
    cells = [Cells(block.type, _native(block.data)) for block in mesh.cells]
    cell = {name: [_native(data) for data in runs] for name, runs in mesh.cell_data.items()}
    arrays = Arrays(
        point={name: _native(data) for name, data in mesh.point_data.items()},
        cell=cell,
        groups=mesh.field_data,
        point_sets=mesh.point_sets,
        cell_sets={
            name: [np.array([] if rows is None else rows, dtype=np.int64) for rows in runs]
            for name, runs in mesh.cell_sets.items()
        },
    )
    return Source(
        points if points.dtype.kind == "f" else points.astype(np.float64),
        cells,
        load=lambda: arrays,
        regions=regions_among(cell),
    )


@contextlib.contextmanager
def _sentences(kind: type[MeshfixError], what: str, path: Path, otherwise: str = "") -> Iterator[None]:
    """Turn whatever meshio raises into one sentence; also its sys.exit, for which it prints the reason."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            yield
        return
    except MeshfixError:
        raise
    except OSError as error:
        # Of ours; those of HDF5 are about what a file names, or its content, and netCDF has numbers below 0 for that.
        if error.filename is not None and (error.errno or 0) > 0:
            raise
        if error.errno in _OF_THE_DEVICE:
            raise OSError(error.errno, os.strerror(error.errno)) from error
        cause: BaseException = error
    except SystemExit as error:
        if error.code not in (None, 1):  # that of a signal: meshio's is 1
            raise
        cause = error
    except Exception as error:
        cause = error
    reason = plainly(cause, printed.getvalue() if isinstance(cause, SystemExit) else "", otherwise)
    raise kind(f"{what} ({reason.replace(str(path), 'it')})") from cause


def _native(array: Any) -> Any:
    """Turn an array to the machine's byte order: readers of binary files leave it as it was there."""
    return array.astype(array.dtype.newbyteorder("=")) if isinstance(array, np.ndarray) else array
