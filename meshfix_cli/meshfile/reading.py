"""From a path or a stream to a document."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from meshfix_cli.errors import MeshfixError, ReadError, naming
from meshfix_cli.kernels import use_threads
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile import foreign, formats
from meshfix_cli.meshfile.compressed import inner, is_compressed, unpacked
from meshfix_cli.meshfile.document import Document, build, with_reversed
from meshfix_cli.meshfile.pieces import join
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Family, Source
from meshfix_cli.meshfile.splice import Turned


def read(
    path: str | os.PathLike[str],
    fix: str | Sequence[str] | None = None,
    regions: str | None = None,
    *,
    fixed: ArrayLike | None = None,
    double: bool = False,
    fix_orientation: bool = False,
    join_points: bool = False,
    form: str | None = None,
    threads: int = 1,
) -> Document:
    """Read a mesh of linear elements, or of straight ones of higher order, all solid or all in a plane.

    Parameters
    ----------
    path : str or path
        "-" reads stdin; one that has a `*`, and is no file, reads the parts of a mesh whose names fit.
    fix : str or sequence of str, optional
        Names of point-data arrays, whose vertices are held where they are not zero, and of sets and groups of points
        or cells, whose vertices are held.
    regions : str, optional
        Name of a cell-data array; the interface between regions is held. "none": none is. Default: those of
        `Source.regions`.
    fixed : (n,) bool or (k,) int, optional
        Points of the file, as a mask or by their indices from 0, that are held.
    double : bool
        Make coordinates in float32 those of a file in float64.
    fix_orientation : bool
        Renumber the elements that have the negative orientation.
    join_points : bool
        Treat points of exactly equal coordinates as one while solving; each of them is written.
    form : str, optional
        The name of the format, one of `formats.readers()`; default: what the file looks like.
    threads : int

    Raises
    ------
    ReadError
        The file cannot be read, holds no mesh of such elements, or a curved one, or not the arrays named.
    InvalidMeshError
        See `Mesh.build`.
    """
    use_threads(threads)
    streamed = os.fspath(path) == "-"
    name = "<stdin>" if streamed else os.fspath(path)
    names = (fix,) if isinstance(fix, str) else tuple(fix or ())

    def built(source: Source, found: Format) -> Document:
        return build(name, source, found, names, regions, join_points, threads, fixed)

    with naming(name):
        source, found = _open(None if streamed else Path(name), double, form, threads)
        document = built(source, found)
        cells = document.reversed_cells() if fix_orientation else {}
        if cells:
            shape, number = document.mesh.topology.element.shape, sum(len(turned.rows) for turned in cells.values())
            note = f"renumbered {counted(number, shape.name, shape.plural)}"
            document = built(_with_reversed(document.source, cells, found, threads), found)
            document = replace(document, notes=(*document.notes, note))
        return document


_OTHERS = {".node": ".ele", ".ele": ".node", ".header": ".nodes", ".nodes": ".header", ".elements": ".header"}


_INDICES = {"pvtu": "Index", "pvtp": "Index", "vtm": "Blocks"}  # by the formats of files that name pieces


def pieces_of(source: str, target: str) -> tuple[list[str], list[str]]:
    """Return where the files are that an index of VTK, a `.foam` or one of two files stand for, and an output's.

    None of what cannot be read.
    """
    here, there, suffix = Path(source), Path(target), Path(source).suffix.lower()
    if suffix == ".foam":
        points = Path("constant", "polyMesh", "points")
        return [str(here.parent / points)], [str(there.parent / points)]
    if other := _OTHERS.get(suffix):
        return [str(here.with_suffix(other))], [str(there.with_suffix(other))]
    name = next((name for name in _INDICES if suffix in formats.OWN[name].extensions), None)
    if name is None:
        return [], []
    try:
        index = _index(name).of(Path(source).read_bytes(), Path(source))
        return [str(path) for path in index.paths], index.targets(target)
    except (OSError, MeshfixError):
        return [], []


def _open(path: Path | None, double: bool, name: str | None, threads: int) -> tuple[Source, Format]:
    """Read what a file holds, or stdin, or several files, and in which format."""
    if path is not None and "*" in str(path) and not path.exists():
        from meshfix_cli.meshfile.gmsh.parts import Parts

        return _open_pieces(Parts.of(str(path)), double, threads)
    if path is not None and set("?[") & set(path.name) and not path.exists():
        raise ReadError("there is no such file; the files of one mesh are named with a *")
    folder = path is not None and (path.is_dir() or path.suffix.lower() == ".foam")
    data = b"" if folder else _read_bytes(path)
    packed = data if is_compressed(data) else None
    if packed is not None:
        data = _not_empty(unpacked(packed))
    form = (
        formats.of_folder(path)
        if folder and path is not None
        else _format(data, Path() if path is None else inner(path), name)
    )
    if form is None:
        raise ReadError(_unknown(data, path))
    # A pipe can be read only once, and nobody but this package looks into what is compressed.
    beside = path if path is not None and (folder or path.is_file()) and packed is None else None
    if form.name in _INDICES:
        _refuse_packed(packed)
        return _open_pieces(_index(form.name).of(data, beside), double, threads)
    source = parse(data, form, beside)
    if double and source.points.dtype != np.float64:
        source = _promoted(data, form, beside)
    return source if packed is None else replace(source, packed=packed), form


def _unknown(data: bytes, path: Path | None) -> str:
    """Say that a format is not recognised, and of the data of an XDMF file, which file that is."""
    if not data.startswith(b"\x89HDF"):
        return "the format is not recognised"
    beside = [path.with_suffix(suffix) for suffix in formats.OWN["xdmf"].extensions] if path is not None else []
    owner = next((f"; {one.name}, beside it, may tell: name that" for one in beside if one.is_file()), "")
    return f"is a file of HDF5 whose format is not recognised{owner}"


def _index(name: str) -> Any:
    """Return the class of files that name the pieces of a mesh."""
    return getattr(_module(Format(name)), _INDICES[name])


def _refuse_packed(packed: bytes | None) -> None:
    """Refuse what is compressed of a mesh in several files."""
    if packed is not None and is_compressed(packed):
        raise ReadError("is compressed, and a mesh in several files is read as it is; unpack it")


def _format(data: bytes, path: Path, name: str | None) -> Format | None:
    """Find out which format a file has, unless its name is given."""
    form = formats.sniff(data)
    if name is not None:
        return form if form is not None and form.reader == name else Format(name)
    other = foreign.name_of(data)
    if other is not None:
        raise ReadError(f"is a file of {other}, which meshfix does not read")
    return form or formats.by_name(path)


def _open_pieces(family: Family, double: bool, threads: int) -> tuple[Source, Format]:
    contents = []
    for name, path in zip(family.names, family.paths, strict=True):
        with naming(name):
            contents.append(_read_bytes(path))
            _refuse_packed(contents[-1])
    with _believable(family.form):
        source = join(family, family.parse(contents), threads)
        if double and source.points.dtype != np.float64:
            family, contents = family.promoted(contents)
            source = join(family, family.parse(contents), threads)
    return source, family.form


def _read_bytes(path: Path | None) -> bytes:
    """Read a file, or stdin."""
    try:
        with nullcontext(sys.stdin.buffer) if path is None else path.open("rb") as stream:
            head = stream.read(formats.HEAD) if _is_device(stream) else b""
            if _is_device(stream) and formats.sniff(head) is None and not is_compressed(head):  # /dev/zero has no end
                raise ReadError("is a device, and no mesh comes from it" if head else "is empty")
            data = stream.read()
            data = head + data if head else data  # which would be a copy
    except OSError as error:
        raise ReadError(error.strerror or str(error)) from error
    return _not_empty(data)


def _not_empty(data: bytes) -> bytes:
    if not data:
        raise ReadError("is empty")
    return data


def _is_device(stream: BinaryIO) -> bool:
    """Whether a stream is a device, and not a terminal."""
    try:
        return stat.S_ISCHR(os.fstat(stream.fileno()).st_mode) and not stream.isatty()
    except OSError:  # one of Python's own has no number
        return False


def parse(data: bytes, form: Format, path: Path | None = None) -> Source:
    """Let the format's own module read; what it does not know, meshio reads, which may look for files beside it."""
    source = None
    if form.reader in formats.OWN:
        with _believable(form):
            module = _module(form)
            source = module.parse(data, path) if formats.OWN[form.reader].beside else module.parse(data)
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
    return import_module(f"meshfix_cli.meshfile.{formats.OWN[form.reader].module}")


def _promoted(data: bytes, form: Format, beside: Path | None) -> Source:
    """Return what the file holds with its coordinates in float64."""
    if form.reader not in formats.OWN or not hasattr(_module(form), "promoted"):
        raise ReadError(f"coordinates of {form.name} files cannot be double")
    return parse(_module(form).promoted(data), form, beside)


def _with_reversed(source: Source, cells: dict[int, Turned], form: Format, threads: int) -> Source:
    if source.pieces is not None:
        return source.pieces.turned(source.points, cells, threads)
    if source.layout is not None:
        turned = parse(source.layout.rewritten(source.points, source.points, cells), form)
        return replace(turned, packed=source.packed)
    return with_reversed(source, cells)
