"""Files of HDF5: their data sets, and where the numbers of these stand in the bytes. The one module that needs h5py.

Where a data set is stored as it is, in one block or in chunks, only the numbers that change are replaced in the bytes.
One that is compressed, or stored with its header, is written by the library into a copy of the file.

Source: The HDF Group, "HDF5 File Format Specification", version 3.0; "HDF5 Reference Manual", H5Dget_offset and
H5Dget_chunk_info.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import MeshfixError, ReadError
from meshfix_cli.meshfile.plainly import plainly
from meshfix_cli.meshfile.source import Layout
from meshfix_cli.meshfile.splice import InPlace, Places, Points, Turned, apply, differing

MOST_LINKS = 16  # that lead to one another
MOST_COMPRESSED = 1100  # times the bytes that are stored; deflate makes a byte of 1032


@contextmanager
def opened(data: bytes | io.BytesIO, form: str, mode: str = "r") -> Iterator[Any]:
    """Give the root of a file.

    Parameters
    ----------
    data : bytes or io.BytesIO
        The latter can be written to with the mode "r+".
    form : str
        What the file is called in sentences.

    Raises
    ------
    ReadError
        h5py is not there; or, also while the file is read, what is in it is damaged.
    """
    try:
        import h5py
    except ImportError as error:
        raise ReadError("is a file of HDF5, which needs h5py: pip install 'meshfix-cli[hdf5]'") from error
    try:
        with h5py.File(data if isinstance(data, io.BytesIO) else io.BytesIO(data), mode) as file:
            yield file
    except (MeshfixError, MemoryError, OverflowError):
        raise
    except Exception as error:  # the library's own are of nearly every type
        raise ReadError(f"is not a readable {form} file ({plainly(error)})") from error


def item(parent: Any, path: str, links: int = 0) -> Any:
    """Return the group or data set at a path from a group; None: there is none.

    Raises
    ------
    ReadError
        It is in another file.
    """
    import h5py

    found = parent.file["/"] if path.startswith("/") else parent
    for name in filter(None, path.split("/")):
        link = found.get(name, getlink=True) if isinstance(found, h5py.Group) else None
        if isinstance(link, h5py.ExternalLink):
            raise ReadError(f"its {name!r} is a link into another file, which meshfix does not follow")
        if isinstance(link, h5py.SoftLink):
            if links == MOST_LINKS:
                raise ReadError(f"its {name!r} is a link that leads to too many others")
            found = item(found, link.path, links + 1)
        else:
            found = None if link is None else found[name]
    return found


def printable(name: str) -> str:
    """Return a name for a sentence."""
    return "".join(letter if letter.isprintable() else "?" for letter in name)


def name_of(found: Any) -> str:
    """Return the path of a group or data set for a sentence."""
    return printable(str(found.name))


def group(parent: Any, path: str) -> Any:
    """Return the group at a path; None: there is none."""
    found = item(parent, path)
    return found if hasattr(found, "keys") else None


def groups(parent: Any) -> dict[str, Any]:
    """Return the groups in a group by their names."""
    found = {name: group(parent, name) for name in parent}
    return {name: one for name, one in found.items() if one is not None}


def data_set(parent: Any, path: str) -> Any:
    """Return the data set at a path; None: there is none.

    Raises
    ------
    ReadError
        It is stored in other files, or announces more than is stored.
    """
    found = item(parent, path)
    if found is None or not hasattr(found, "shape"):
        return None
    if found.external or found.is_virtual:
        raise ReadError(f"its {name_of(found)} is stored in other files, which meshfix does not read")
    stored = min(found.id.get_storage_size(), found.file.id.get_filesize())
    if found.shape is None or found.size * found.dtype.itemsize > MOST_COMPRESSED * stored:
        raise ReadError(f"is truncated: its {name_of(found)} announces more than is stored")
    return found


def numbers(found: Any, kinds: str) -> NDArray[Any]:
    """Return the numbers of a data set in the machine's byte order.

    Parameters
    ----------
    kinds : str
        numpy's letters for what they may be: "iu" or "f".

    Raises
    ------
    ReadError
        They are something else.
    """
    if found.dtype.kind not in kinds:
        raise ReadError(f"its {name_of(found)} does not hold {'integers' if 'i' in kinds else 'numbers'}")
    return np.asarray(found[()]).astype(found.dtype.newbyteorder("="), copy=False)


def attribute(owner: Any, name: str, default: Any = None) -> Any:
    """Return an attribute: a text as such, and a number as such where there is one."""
    if name not in owner.attrs:
        return default
    value = np.asarray(owner.attrs[name])
    one = value.item() if value.size == 1 else value
    return one.decode("utf-8", "replace") if isinstance(one, bytes) else one


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of numbers in data sets.

    Attributes
    ----------
    sets : sequence of str
        The paths of the data sets.
    at : (n, k) int64
        Where each number stands among those of all data sets, one after the other.
    """

    sets: Sequence[str]
    at: NDArray[np.int64]

    @classmethod
    def by_row(cls, path: str, n: int, k: int) -> Table:
        """All numbers of a data set, row by row."""
        return cls([path], np.arange(n * k).reshape(n, k))

    @classmethod
    def by_column(cls, sets: Sequence[str], n: int, k: int) -> Table:
        """All numbers of a data set, or of one for each column, column by column."""
        return cls(sets, np.arange(n * k).reshape(k, n).T)

    def read(self, root: Any) -> NDArray[np.floating[Any]]:
        """Return coordinates (n, k), in float32 or float64."""
        return np.concatenate([numbers(found, "f").ravel() for found in self._found(root)])[self.at]

    def _found(self, root: Any) -> list[Any]:
        """The data sets."""
        return [data_set(root, path) for path in self.sets]

    def places(self, root: Any) -> Places | None:
        """Return where the numbers stand in the bytes; None: they are compressed, or not all stored, or in a header."""
        found = self._found(root)
        begin = [offsets for offsets in map(_offsets, found) if offsets is not None]
        if len(begin) < len(found) or len({one.dtype.str for one in found}) != 1:
            return None
        return Places(np.concatenate(begin)[self.at], None, np.dtype(found[0].dtype.str))

    def written(self, data: bytes, form: str, edit: Callable[[NDArray[Any]], None]) -> bytes:
        """Return a file in which the library writes the data sets after an edit of their numbers (N,)."""
        stream = io.BytesIO(data)
        with opened(stream, form, "r+") as root:
            found = self._found(root)
            old = [one[()] for one in found]
            new = np.concatenate([values.ravel() for values in old])
            edit(new)
            ends = np.cumsum([values.size for values in old])
            for one, values, part in zip(found, old, np.split(new, ends[:-1]), strict=True):
                if part.tobytes() != values.tobytes():
                    one[...] = part.reshape(values.shape)
        return stream.getvalue()


def layout(root: Any, data: bytes, form: str, points: Table, corners: Sequence[Callable[[], Table]]) -> Layout:
    """Return where a file holds its coordinates, and the vertices of each run of cells.

    Raises
    ------
    ReadError
        The coordinates are neither in single nor in double precision.
    """
    kinds = {data_set(root, path).dtype for path in points.sets}
    if not {kind.str[1:] for kind in kinds} <= {"f4"} and not {kind.str[1:] for kind in kinds} <= {"f8"}:
        raise ReadError(f"is not a readable {form} file: its coordinates are not all of single or of double precision")
    places = points.places(root)
    # What the library says of places is not believed where it reads other numbers.
    if places is not None and places.read(data).tobytes() == points.read(root).tobytes():
        return _InBytes(data, places, (), form, corners)
    return _Written(data, points, np.dtype(kinds.pop()).newbyteorder("="), form, corners)


@dataclass(frozen=True, eq=False)
class _InBytes(InPlace):
    """Coordinates that stand in the bytes as they are, and vertices that may do so."""

    form: str
    tables: Sequence[Callable[[], Table]]

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, d), and with some cells turned."""
        moved = super().rewritten(original, points, {})
        return _turned(moved, self.form, self.tables, reversed_cells)


@dataclass(frozen=True, eq=False)
class _Written:
    """Coordinates that the library must write."""

    data: bytes = field(repr=False)
    points: Table
    dtype: np.dtype[Any]
    form: str
    tables: Sequence[Callable[[], Table]]

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the file can hold them."""
        return points.astype(self.dtype, copy=False)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, d), and with some cells turned."""
        which = differing(original, points)

        def move(numbers: NDArray[Any]) -> None:
            numbers[self.points.at[which]] = points[which]

        moved = self.points.written(self.data, self.form, move) if which.any() else self.data
        return _turned(moved, self.form, self.tables, reversed_cells)


def _turned(data: bytes, form: str, tables: Sequence[Callable[[], Table]], cells: Mapping[int, Turned]) -> bytes:
    """Return a file with some cells turned."""
    for run, some in cells.items():
        table = tables[run]()
        there, here = (table.at[some.rows[:, None], columns] for columns in some.places)
        with opened(data, form) as root:
            places = table.places(root)

        def turn(numbers: NDArray[Any], there: NDArray[Any] = there, here: NDArray[Any] = here) -> None:
            numbers[there] = numbers[here]

        data = table.written(data, form, turn) if places is None else apply(data, [places.turn(data, some)])
    return data


def _offsets(found: Any) -> NDArray[np.int64] | None:
    """Return where each number (N,) of a data set begins in the bytes; None: not all stand there as they are."""
    import h5py

    kind = found.id.get_create_plist()
    size = found.dtype.itemsize
    if kind.get_nfilters():
        return None
    if kind.get_layout() == h5py.h5d.CONTIGUOUS:
        at = found.id.get_offset()
        return None if at is None else at + size * np.arange(found.size)
    return _offsets_in_chunks(found, size) if kind.get_layout() == h5py.h5d.CHUNKED else None


def _offsets_in_chunks(found: Any, size: int) -> NDArray[np.int64] | None:
    """The same where the data set is cut into boxes, of which those at its ends are stored whole."""
    inside = size * np.arange(math.prod(found.chunks)).reshape(found.chunks)
    begin = np.empty(found.shape, dtype=np.int64)
    for corner in product(*(range(0, n, step) for n, step in zip(found.shape, found.chunks, strict=True))):
        at = found.id.get_chunk_info_by_coord(corner).byte_offset
        if at is None:
            return None
        ends = [min(step, n - first) for first, step, n in zip(corner, found.chunks, found.shape, strict=True)]
        box = tuple(slice(first, first + end) for first, end in zip(corner, ends, strict=True))
        begin[box] = at + inside[tuple(map(slice, ends))]
    return begin.ravel()
