"""Path or stream <-> Mesh. The only importer of meshio."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli._kernels import use_threads
from meshfix_cli.errors import MeshfixError, ReadError, WriteError, naming
from meshfix_cli.mesh import CELL_NAMES, Mesh
from meshfix_cli.meshfile import formats
from meshfix_cli.meshfile.atomic import check_target, is_stream, write_file, write_files, write_text
from meshfix_cli.meshfile.document import Document, build, counted, with_reversed
from meshfix_cli.meshfile.formats import PARTS, Format
from meshfix_cli.meshfile.pieces import Family, join
from meshfix_cli.meshfile.source import SIMPLEX, Arrays, Cells, Layout, Source
from meshfix_cli.meshfile.splice import InPlace, Places, Points, differing

__all__ = [
    "Document",
    "Put",
    "check_cells",
    "check_pieces",
    "check_target",
    "is_stream",
    "output_format",
    "pieces_of",
    "read",
    "write",
    "write_cells",
    "write_file",
    "write_text",
]

Put = Callable[[Path, Places, Points, NDArray[np.bool_]], None]

ROUNDING = 1e-4  # relative to the size of the mesh: more than any format rounds, less than any mesh can bear


def read(
    path: str | os.PathLike[str],
    fix: str | None = None,
    regions: str | None = None,
    *,
    double: bool = False,
    fix_orientation: bool = False,
    threads: int = 1,
) -> Document:
    """Read a triangle or tetrahedral mesh.

    Parameters
    ----------
    path : str or path
        "-" reads stdin; one that has a `*`, and is no file, reads the parts of a mesh whose names fit.
    fix : str, optional
        Name of a point-data array; vertices where it is not zero are held.
    regions : str, optional
        Name of a cell-data array; the interface between regions is held. Default: those of `Source.regions`.
    double : bool
        Make coordinates in float32 those of a file in float64.
    fix_orientation : bool
        Renumber the simplices that have the negative orientation, by exchanging two of their vertices.
    threads : int

    Raises
    ------
    ReadError
        The file cannot be read, holds no mesh of simplices, or not the arrays named.
    InvalidMeshError
        See `Mesh.build`.
    """
    use_threads(threads)
    streamed = os.fspath(path) == "-"
    name = "<stdin>" if streamed else os.fspath(path)
    with naming(name):
        source, form = _open(None if streamed else Path(name), double, threads)
        document = build(name, source, form, fix, regions, threads)
        rows = document.reversed_cells() if fix_orientation else {}
        if rows:
            note = f"renumbered {counted(sum(map(len, rows.values())), *CELL_NAMES[document.mesh.dimension])}"
            document = build(name, _with_reversed(document.source, rows, form, threads), form, fix, regions, threads)
            document = replace(document, notes=(*document.notes, note))
        return document


def write(
    document: Document,
    mesh: Mesh,
    target: str | os.PathLike[str],
    form: Format | None = None,
    backup: bool = False,
    put: Put | None = None,
) -> tuple[Mesh, tuple[str, ...]]:
    """Write a moved mesh; return it as the file holds it, and what was dropped.

    In the format it came in, every byte outside the coordinates that moved stays as it was, where the format's own
    module has read it; otherwise meshio writes what both formats hold.

    Parameters
    ----------
    document : Document
    mesh : Mesh
        Made of `document.mesh` by moving vertices.
    target : str or path
        Replaced at once or not at all; "-" writes to stdout. Of a mesh in pieces it is what was read, or its like:
        the name of a .pvtu, or one with a `*`.
    form : Format, optional
        Default: see `output_format`.
    backup : bool
        Keep what `target` was as `target.bak`, or, where that exists, `target.bak1` and so on.
    put : callable, optional
        (path, places, points, where they changed): writes the coordinates into a copy of a binary file.

    Raises
    ------
    WriteError
        Nothing was written.
    """
    target = os.fspath(target)
    form = form or output_format(document, target)
    check_target(target)
    check_pieces(document, target, form)
    points, source, put = document.file_points(mesh), document.source, None if is_stream(target) else put
    stored = document.in_plane(points.astype(np.float64), mesh)
    layout, pieces = (source.layout, source.pieces) if form == document.format else (None, None)
    if pieces is not None:
        write_files(pieces.files(target, source.points, points), backup)
        return stored, ()
    if layout is not None:
        write_file(target, partial(_splice, layout, source.points, points, put), backup)
        return stored, ()
    dropped: tuple[str, ...] = ()

    def produce(temporary: Path) -> None:
        nonlocal stored, dropped
        try:
            held, dropped = _write_anew(temporary, source.merged(), points, form, mesh.dimension)
        except WriteError as error:
            raise WriteError(f"{target}: {error}") from error
        stored = document.in_plane(held, mesh)

    write_file(target, produce, backup)
    return stored, dropped


def _splice(layout: Layout, original: Points, points: Points, put: Put | None, path: Path) -> None:
    if put is None or not (isinstance(layout, InPlace) and layout.binary):
        path.write_bytes(layout.rewritten(original, points, {}))
        return
    path.write_bytes(layout.data)
    put(path, layout.coordinates, points, differing(original, points))


def write_cells(
    document: Document,
    mesh: Mesh,
    target: str,
    cell: Mapping[str, NDArray[Any]],
    point: Mapping[str, NDArray[Any]],
) -> None:
    """Write the simplices of a moved mesh with data for each, for programs that draw them.

    Parameters
    ----------
    target : str
        Its extension tells the format, any that holds cell data.
    cell : mapping
        An array (m, ...) for each name.
    point : mapping
        An array (n, ...) for each name.

    Raises
    ------
    WriteError
        Nothing was written.
    """
    form = check_cells(document, target)
    arrays = Arrays(point=point, cell={name: [values] for name, values in cell.items()})
    source = Source(
        document.file_points(mesh), [Cells(SIMPLEX[mesh.dimension], document.simplices)], load=lambda: arrays
    )

    def produce(temporary: Path) -> None:
        _write_anew(temporary, source, source.points, form, mesh.dimension)

    write_file(target, produce)


def check_cells(document: Document, target: str) -> Format:
    """Return the format of a file for `write_cells`; WriteError where that does not hold the data."""
    form = output_format(document, target)
    if form.reader not in ("vtk", "vtu"):
        raise WriteError(f"{target}: quality can be drawn from .vtu and .vtk files, and this would be {form.name}")
    return form


def check_pieces(document: Document, target: str, form: Format) -> None:
    """Raise WriteError now, before any work, where the pieces of a mesh cannot be written for this target."""
    if document.source.pieces is not None:
        document.source.pieces.check(target, form == document.format)


def output_format(document: Document, target: str, name: str | None = None) -> Format:
    """Return the format of the output: the one named, else that of the target's extension, else the input's.

    A target that is the input keeps its format, and one with an extension that is not known has it. A mesh that was
    read in parts is written so where its format stays.

    Raises
    ------
    WriteError
        The format cannot be written.
    """
    in_parts = document.format == PARTS
    if "*" in Path(target).name and not Path(target).exists():
        if not in_parts or name is not None:
            raise WriteError(f"{target}: a * in OUTPUT is for a mesh in parts, which are read by a * in INPUT")
        return document.format
    if name is not None:
        form = Format(name)
    elif target == "-" or document.is_file(target):
        form = document.format
    else:
        form = formats.by_name(Path(target)) or document.format
        if in_parts and form.reader == "gmsh":
            return document.format
    if form.reader == document.format.reader and name is None:
        return document.format if document.source.spliced else _writable(document.format, target)
    if form.binary is None and form.name in formats.BOTH:
        form = Format(form.name, bool(document.format.binary))
    return document.format if form == document.format else _writable(form, target)


def pieces_of(source: str, target: str) -> tuple[list[str], list[str]]:
    """Return where the pieces of a `.pvtu` are, and where those of an output would be; none of what cannot be read."""
    if Path(source).suffix.lower() != ".pvtu":
        return [], []
    from meshfix_cli.meshfile.pvtu import Index

    try:
        index = Index.of(Path(source).read_bytes(), Path(source))
        return [str(path) for path in index.paths], index.targets(target)
    except (OSError, MeshfixError):
        return [], []


def _writable(form: Format, target: str) -> Format:
    if form.name == "gmsh":  # meshio leaves out entities that own no node, and gmsh does not open that
        raise WriteError(f"{target}: files of gmsh 4.1 are written back, but not made of others; use --format gmsh22")
    if form.name not in formats.writers():
        raise WriteError(f"{target}: the format {form.name} cannot be written")
    return form


def _open(path: Path | None, double: bool, threads: int) -> tuple[Source, Format]:
    """Read what a file holds, or stdin, or several files, and in which format."""
    if path is not None and "*" in str(path) and not path.exists():
        from meshfix_cli.meshfile.parts import Parts

        return _open_pieces(Parts.of(str(path)), double, threads)
    if path is not None and set("?[") & set(path.name) and not path.exists():
        raise ReadError("there is no such file; the files of one mesh are named with a *")
    data = _read_bytes(path)
    form = formats.sniff(data) or formats.by_name(Path() if path is None else path)
    if form is None:
        raise ReadError("the format is not recognised")
    beside = path if path is not None and path.is_file() else None  # a pipe can be read only once
    if form.name == "pvtu":
        from meshfix_cli.meshfile.pvtu import Index

        return _open_pieces(Index.of(data, beside), double, threads)
    source = _parse(data, form, beside)
    if double and source.points.dtype != np.float64:
        source = _promoted(data, form)
    return source, form


def _open_pieces(family: Family, double: bool, threads: int) -> tuple[Source, Format]:
    contents = []
    for name, path in zip(family.names, family.paths, strict=True):
        with naming(name):
            contents.append(_read_bytes(path))
    with _believable(family.form):
        source = join(family, family.parse(contents), threads)
        if double and source.points.dtype != np.float64:
            family, contents = family.promoted(contents)
            source = join(family, family.parse(contents), threads)
    return source, family.form


def _read_bytes(path: Path | None) -> bytes:
    """Read a file, or stdin."""
    try:
        data = sys.stdin.buffer.read() if path is None else path.read_bytes()
    except OSError as error:
        raise ReadError(error.strerror or str(error)) from error
    if not data:
        raise ReadError("is empty")
    return data


def _parse(data: bytes, form: Format, path: Path | None = None) -> Source:
    """Let the format's own module read; what it does not know, meshio reads, which may look for files beside it."""
    source = None
    if form.reader in formats.OWN:
        with _believable(form):
            source = _module(form).parse(data)
    if source is None:
        from meshfix_cli.meshfile import through_meshio

        source = through_meshio.read(data, form, path)
    return source


@contextmanager
def _believable(form: Format) -> Iterator[None]:
    try:
        yield
    except (OverflowError, MemoryError) as error:  # a count that no file can keep
        raise ReadError(f"is not a readable {form.name} file: it announces more than it holds") from error


def _module(form: Format) -> Any:
    """Imported when a file needs it: a run reads one format."""
    return import_module(f"meshfix_cli.meshfile.{form.reader}")


def _promoted(data: bytes, form: Format) -> Source:
    """Return what the file holds with its coordinates in float64."""
    if form.reader not in formats.OWN or not hasattr(_module(form), "promoted"):
        raise ReadError(f"coordinates of {form.name} files cannot be double")
    return _parse(_module(form).promoted(data), form)


def _with_reversed(source: Source, rows: dict[int, NDArray[np.int64]], form: Format, threads: int) -> Source:
    if source.pieces is not None:
        family = source.pieces.family
        return join(family, family.parse(list(source.pieces.rewritten(source.points, source.points, rows))), threads)
    if source.layout is not None:
        return _parse(source.layout.rewritten(source.points, source.points, rows), form)
    return with_reversed(source, rows)


def _write_anew(
    path: Path, source: Source, points: NDArray[np.floating[Any]], form: Format, dimension: int
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Let meshio write, and read it again: return the points (n, d) as the file holds them, and what was dropped.

    Raises
    ------
    WriteError
        The format cannot hold the simplices of this dimension, or rounds them too much.
    """
    from meshfix_cli.meshfile import through_meshio

    through_meshio.write(path, source, points, form)
    kind = SIMPLEX[dimension], dimension + 1
    expected = source.vertices_of(*kind)
    held = points.astype(np.float64)
    size = float(np.ptp(held[expected], axis=(0, 1)).max())
    try:
        back = _parse(path.read_bytes(), form, path)
        if not len(back.vertices_of(*kind)):
            raise WriteError(f"cannot be written as {form.name}: that holds no {CELL_NAMES[dimension][1]}")
        corners = _spatial(back.points)[back.vertices_of(*kind)]
        difference = np.abs(corners - _spatial(held)[expected]).max()
        dropped = source.lost_in(back)
        if back.arrays.unread:
            raise WriteError(f"cannot be written as {form.name}: it would hold {back.arrays.unread[0]}")
    except WriteError:
        raise
    except (MeshfixError, IndexError, ValueError) as error:
        raise WriteError(f"cannot be written as {form.name}: what was written does not read back") from error
    if not difference <= ROUNDING * size:
        raise WriteError(f"cannot be written as {form.name}: the coordinates do not read back")
    held[expected] = corners[:, :, : held.shape[1]]
    return held, dropped


def _spatial(points: Any) -> NDArray[np.float64]:
    """Points with three coordinates."""
    p = np.asarray(points, dtype=np.float64)
    return np.hstack([p, np.zeros((len(p), 3 - p.shape[1]))]) if p.shape[1] < 3 else p
