"""Legacy files of VTK, of versions 4.2 and 5.1: unstructured grids, as text or binary.

Source: "VTK File Formats", section Simple Legacy Formats.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.anew.content import Content, words_of
from meshfix_cli.meshfile.anew.grid import Grid
from meshfix_cli.meshfile.anew.tables import rows_of
from meshfix_cli.meshfile.recognise import Format

_TYPES = {
    "i1": "char", "u1": "unsigned_char", "i2": "short", "u2": "unsigned_short", "i4": "int", "u4": "unsigned_int",
    "i8": "vtktypeint64", "u8": "vtktypeuint64", "f4": "float", "f8": "double",
}  # fmt: skip

_LONGEST = 200  # characters of a name: VTK reads lines of 255


def written(content: Content, form: Format) -> bytes:
    """Return a file."""
    old = form.name == "vtk42"
    return b"".join(_parts(Grid.of(content, form, old), old, form.binary is not False))


def _parts(grid: Grid, old: bool, binary: bool) -> Iterator[bytes]:
    version, coding = "4.2" if old else "5.1", "BINARY" if binary else "ASCII"
    yield f"# vtk DataFile Version {version}\nwritten by meshfix\n{coding}\nDATASET UNSTRUCTURED_GRID\n".encode()
    yield from _fields(grid.about, old, binary)
    yield f"POINTS {len(grid.points)} double\n".encode()
    yield _numbers(grid.points, binary)
    yield from (_cells_of_4 if old else _cells_of_5)(grid, binary)
    kinds = grid.kinds().astype(np.int32)
    yield f"CELL_TYPES {len(kinds)}\n".encode()
    yield _numbers(kinds, binary)
    for section, count, arrays in (("POINT", len(grid.points), grid.point), ("CELL", len(kinds), grid.cell)):
        if arrays:
            yield f"{section}_DATA {count}\n".encode()
            yield from _fields(arrays, old, binary)


def _cells_of_4(grid: Grid, binary: bool) -> Iterator[bytes]:
    """Before the vertices of each cell stands how many they are."""
    tables = [np.insert(rows.astype(np.int32), 0, rows.shape[1], axis=1) for rows in grid.vertices]
    yield f"CELLS {sum(map(len, tables))} {sum(one.size for one in tables)}\n".encode()
    yield from (_numbers(one, binary, i == len(tables) - 1) for i, one in enumerate(tables))


def _cells_of_5(grid: Grid, binary: bool) -> Iterator[bytes]:
    """Where the vertices of each cell begin, one number more than there are cells, and all vertices."""
    offsets = np.concatenate([[0], grid.offsets()])
    yield f"CELLS {len(offsets)} {offsets[-1]}\nOFFSETS vtktypeint64\n".encode()
    yield _numbers(offsets, binary)
    yield b"CONNECTIVITY vtktypeint64\n"
    yield from (_numbers(one, binary, i == len(grid.vertices) - 1) for i, one in enumerate(grid.vertices))


def _fields(arrays: Mapping[str, NDArray[Any]], old: bool, binary: bool) -> Iterator[bytes]:
    if arrays:
        yield f"FIELD FieldData {len(arrays)}\n".encode()
    words = words_of(list(arrays), "!-~", _LONGEST, spelled=_name)
    for name, array in arrays.items():
        values = _narrow(array) if old else _wide(array)
        columns = 1 if values.ndim == 1 else values.shape[1]
        yield f"{words[name]} {columns} {len(values)} {_TYPES[values.dtype.str[1:]]}\n".encode()
        yield _numbers(values, binary)


def _narrow(values: NDArray[Any]) -> NDArray[Any]:
    """Return integers in 32 bits where they fit: not all readers of old files have a word for 64."""
    small = np.dtype(f"{values.dtype.kind}4") if values.dtype.kind in "iu" and values.itemsize == 8 else values.dtype
    return values.astype(small) if (values.astype(small) == values).all() else values


def _wide(values: NDArray[Any]) -> NDArray[Any]:
    """Return integers of 32 bits in 64: some readers of new files take these for any integer."""
    return values.astype(np.int64) if values.dtype == np.int32 else values


def _numbers(values: NDArray[Any], binary: bool, last: bool = True) -> bytes:
    """Return numbers, and the end of a line behind the last."""
    if binary:
        return values.astype(values.dtype.newbyteorder(">")).tobytes() + b"\n" * last
    return rows_of(values)


def _name(name: str) -> str:
    """Return a name as a word: blanks and what is no plain character are given by their codes, as VTK does."""
    return "".join(chr(c) if 32 < c < 127 and c not in b'"%' else f"%{c:02X}" for c in name.encode()) or "_"
