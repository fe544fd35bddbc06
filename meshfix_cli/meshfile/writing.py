"""From a document and moved points to a file, or to a stream."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import MeshfixError, WriteError
from meshfix_cli.mesh.elements import counted, dimension_of, words
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile import anew, compressed, foreign, formats
from meshfix_cli.meshfile.atomic import check_target, is_stream, write_file, write_files
from meshfix_cli.meshfile.document import Document
from meshfix_cli.meshfile.formats import PARTS
from meshfix_cli.meshfile.lost import lost
from meshfix_cli.meshfile.reading import parse
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.solved import in_common_types, solved_runs
from meshfix_cli.meshfile.source import Arrays, Cells, Layout, Source
from meshfix_cli.meshfile.splice import InPlace, Places, Points, differing

Put = Callable[[Path, Places, Points, NDArray[np.bool_]], None]
UNORIENTED = ("dolfin-xml", "xdmf")  # whose programs number cells with no regard to their orientation
_WITH_CELLS = ("vtu", "vtk")  # what programs draw data of cells from
ROUNDING = 1e-4  # relative to the size of the mesh: more than any format rounds, less than any mesh can bear


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
    check_output(document, target, form)
    packed = is_packed(document, target)
    points, source, put = document.file_points(mesh), document.source, None if packed or is_stream(target) else put
    stored = document.in_plane(points.astype(np.float64), mesh)
    layout, pieces = (source.layout, source.pieces) if form == document.format else (None, None)
    if pieces is not None:
        write_files(pieces.files(target, source.points, points), backup)
        return stored, ()
    same = form == document.format and points.tobytes() == source.points.tobytes()

    def write_one(produce: Callable[[Path], object]) -> None:
        write_file(target, partial(_pack, produce, source.packed if same else None) if packed else produce, backup)

    if layout is not None:
        write_one(partial(_splice, layout, source.points, points, put))
        return stored, ()
    dropped: tuple[str, ...] = ()
    unmoved = source.data if document.is_as_read(mesh, form) else None

    def produce(temporary: Path) -> None:
        nonlocal stored, dropped
        if unmoved is not None:
            temporary.write_bytes(unmoved)
            return
        try:
            anew = source if form.reader in UNORIENTED else document.oriented()
            held, dropped = _write_anew(temporary, _merged(anew, form), points, form)
        except WriteError as error:
            raise WriteError(f"{target}: {error}") from error
        if form == document.format and source.data is not None:
            dropped = (*dropped, *foreign.words_lost(source.data, temporary.read_bytes()))
        stored = document.in_plane(held, mesh)

    write_one(produce)
    return stored, dropped


def is_packed(document: Document, target: str) -> bool:
    """Whether an output is compressed: by its name or, in the place of the input and on stdout, as the input is."""
    if target == "-" or document.is_file(target):
        return document.source.packed is not None
    return compressed.has_suffix(Path(target))


def _pack(produce: Callable[[Path], object], original: bytes | None, path: Path) -> None:
    """Compress what is produced; the original, where that holds the same, stays as it was compressed."""
    plain = path.with_name(f"unpacked_{compressed.inner(path).name}")
    produce(plain)
    data = plain.read_bytes()
    kept = original is not None and compressed.unpacked(original) == data
    path.write_bytes(original if original is not None and kept else compressed.packed(data))


def _splice(layout: Layout, original: Points, points: Points, put: Put | None, path: Path) -> None:
    if put is None or not (isinstance(layout, InPlace) and layout.binary):
        if isinstance(layout, InPlace):
            with path.open("wb") as out:
                out.writelines(layout.moved(original, points))
        else:
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
    """Write the elements of a moved mesh with data for each, for programs that draw them.

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
    parts = document.parts
    ends = np.cumsum([len(part.vertices) for part in parts])
    arrays = Arrays(point=point, cell={name: np.split(values, ends[:-1]) for name, values in cell.items()})
    cells = [Cells(part.key, part.vertices) for part in parts]
    source = Source(document.file_points(mesh), cells, load=lambda: arrays).merged()

    def produce(temporary: Path) -> None:
        _write_anew(temporary, source, source.points, form)

    write_file(target, produce)


def check_cells(document: Document, target: str) -> Format:
    """Return the format of a file for `write_cells`; WriteError where that does not hold the data."""
    form = output_format(document, target)
    if form.reader not in _WITH_CELLS:
        known = " and ".join(cells_extensions())
        raise WriteError(f"{target}: quality can be drawn from {known} files, and this would be {form.name}")
    return form


def cells_extensions() -> tuple[str, ...]:
    """Return the extensions of the files that `write_cells` makes."""
    return tuple(extension for name in _WITH_CELLS for extension in formats.OWN[name].extensions)


def check_output(document: Document, target: str, form: Format) -> None:
    """Raise WriteError now, before any work, where an output cannot be or would replace a piece of the input."""
    pieces = document.source.pieces
    if pieces is not None and form == document.format:
        if is_packed(document, target):
            raise WriteError(f"{target}: a mesh in several files is not compressed; name an OUTPUT without .gz")
        folder = Path(target).is_dir()
        if is_stream(target) and not folder:
            name = "<stdout>" if target == "-" else target
            several = "a mesh in several files cannot go into a stream"
            raise WriteError(f"{name}: {several}; name an OUTPUT, or a --format")
        targets = pieces.targets(target)
        if not (folder and all(Path(one).is_relative_to(target) for one in targets)):
            check_target(target)
        for path in targets:
            if Path(path).parent.is_dir():  # else it will be made
                check_target(path)
        return
    check_target(target)
    if pieces is not None and Path(target).resolve() in [path.resolve() for path in pieces.paths]:
        raise WriteError(f"{target}: is a piece of the input; name another OUTPUT")


def output_format(document: Document, target: str, name: str | None = None) -> Format:
    """Return the format of the output: the one named, else that of the target's extension, else the input's.

    A target that is the input keeps its format, and one with an extension that is not known, or that several formats
    have, has it. A mesh that was read in parts is written so where its format stays.

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
    elif target == "-" or document.is_file(target) or formats.may_be(document.format, Path(target)):
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


def unknown_extension(document: Document, target: str) -> str | None:
    """Return the extension of a target, as written, if it names no format and is not that of the input."""
    extension, mine = (compressed.inner(Path(name)).suffix for name in (target, document.name))
    if not extension or extension == mine or formats.by_name(Path(target)) is not None:
        return None
    return extension


def other_format(document: Document, target: str) -> str | None:
    """Return the format for which an extension stands first, where the input's has another and keeps its format."""
    extension, mine = (compressed.inner(Path(name)).suffix.lower() for name in (target, document.name))
    other = formats.by_name(Path(target))
    shared = other is not None and other.reader != document.format.reader
    keeps = extension != mine and formats.may_be(document.format, Path(target))
    return other.name if other is not None and shared and keeps else None


def _writable(form: Format, target: str) -> Format:
    name = compressed.inner(Path(target)).name
    if form.name == "ugrid" and not re.search(r"\.l?[br](?:4|8)l?\.ugrid$", name):  # meshio writes numpy's repr
        raise WriteError(f"{target}: text files of UGRID cannot be written; name a .b8.ugrid")
    if form.name not in formats.writers():
        others = ", ".join(sorted(anew.WRITERS))
        raise WriteError(f"{target}: the format {form.name} cannot be made of another; among those that can: {others}")
    return form


def _merged(source: Source, form: Format) -> Source:
    """Return a source with one run for each type, and with no types that only VTK has, where the format is another."""
    if form.reader in _WITH_CELLS:
        return source.merged()
    return replace(source, cells=[in_common_types(run) for run in source.cells], load=lambda: source.arrays).merged()


def _write_anew(
    path: Path, source: Source, points: NDArray[np.floating[Any]], form: Format
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Write and read again; return the points (n, d) as the file holds them, and what was dropped.

    Cells that name points that are not there are left out: other programs would refuse the file, or read beyond it.

    Raises
    ------
    WriteError
        The format cannot hold the elements that are solved for, or rounds them too much.
    """
    count = sum(len(run.vertices) for run in source.cells)
    source = source.there()
    count -= sum(len(run.vertices) for run in source.cells)
    astray = (f"{counted(count, 'cell', 'cells')} that named points that are not there",) if count else ()
    if form.name in anew.WRITERS:
        prepared = anew.prepared(source, form)
        path.write_bytes(anew.written(prepared, points, form))
        if prepared is not source:  # its cells have numbers there, by which they are found
            source = source.in_order(prepared)
    else:
        from meshfix_cli.meshfile import through_meshio

        through_meshio.write(path, source, points, form)
    runs = [source.cells[i] for i in solved_runs(source.cells)]
    expected = np.concatenate([run.vertices.ravel() for run in runs])
    held = points.astype(np.float64)
    size = float(np.ptp(held[expected], axis=0).max())
    try:
        back = parse(path.read_bytes(), form, path).in_order()  # some formats part what belongs to several materials
        found = [back.vertices_of(run.type, run.vertices.shape[1]) for run in runs]
        lacking = next((run for run, rows in zip(runs, found, strict=True) if not len(rows)), None)
        if lacking is not None:
            where = " in space" if points.shape[1] == 3 and dimension_of(lacking.type) == 2 else ""
            raise WriteError(f"cannot be written as {form.name}: that holds no {words(lacking.type)[1]}{where}")
        corners = _spatial(back.points)[np.concatenate([rows.ravel() for rows in found])]
        difference = np.abs(corners - _spatial(held)[expected]).max()
        dropped = (*astray, *lost(source, back))
        if back.arrays.unread:
            raise WriteError(f"cannot be written as {form.name}: it would hold {back.arrays.unread[0]}")
    except WriteError:
        raise
    except (MeshfixError, IndexError, ValueError) as error:
        raise WriteError(f"cannot be written as {form.name}: what was written does not read back") from error
    if not difference <= ROUNDING * size:
        raise WriteError(f"cannot be written as {form.name}: the coordinates do not read back")
    held[expected] = corners[:, : held.shape[1]]
    return held, dropped


def _spatial(points: Any) -> NDArray[np.float64]:
    """Points with three coordinates."""
    p = np.asarray(points, dtype=np.float64)
    return np.hstack([p, np.zeros((len(p), 3 - p.shape[1]))]) if p.shape[1] < 3 else p
