"""The numbers of an XDMF file: text in it, or data sets of HDF5 and raw bytes in files beside it.

Source: XDMF, "XDMF Model and Format", section DataItem.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import unescape
from itertools import takewhile
from os.path import normpath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, naming
from meshfix_cli.meshfile import hdf5
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.splice import Places
from meshfix_cli.meshfile.text import in_line, numbers_at, short_integers, words
from meshfix_cli.meshfile.vtk.xml import Element
from meshfix_cli.meshfile.xdmf.tree import Tree, said

_KINDS = {
    "float": "f", "int": "i", "uint": "u", "char": "i", "uchar": "u", "short": "i", "ushort": "u",
}  # fmt: skip
_SIZES = {"char": 1, "uchar": 1, "short": 2, "ushort": 2}
_ORDERS = {"": "=", "native": "=", "little": "<", "big": ">"}
Beside = Callable[[str], bytes]  # gives the content of a file that is named


@dataclass(frozen=True, eq=False)
class Item:
    """Numbers, and where they are.

    Attributes
    ----------
    element : Element
    form : {"xml", "hdf", "binary"}
    dtype : numpy dtype
        As the file says; data sets have one of their own.
    shape : tuple of int
    file : str
        The name of the file that has them; empty: this one.
    path : str
        That of the data set.
    seek : int
        The offset of the first byte.
    """

    element: Element
    form: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    file: str = ""
    path: str = ""
    seek: int = 0

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return math.prod(self.shape)

    @property
    def place(self) -> tuple[object, ...]:
        """What is the same for two that are the same numbers."""
        return (self.file, self.path, self.seek) if self.file else (self.element.at,)


def item_of(tree: Tree, parent: Element, number: int = 0) -> Item:
    """Return what one of the data items of an element is."""
    found = tree.within(parent, "DataItem")
    if number >= len(found):
        raise ReadError(f"is not a readable xdmf file: a {parent.tag} has {len(found)} data items")
    element = found[number]
    if (said(element, "ItemType") or "uniform") != "uniform":
        raise ReadError("has data items that are parts or functions of others, which meshfix does not read")
    kind = said(element, "NumberType", "DataType") or "float"
    dimensions = element.attributes.get("Dimensions", "").split()
    precision = said(element, "Precision")
    form = (said(element, "Format") or "xml").replace("hdf5", "hdf")
    if kind not in _KINDS or form not in ("xml", "hdf", "binary") or precision not in ("", "1", "2", "4", "8"):
        raise ReadError(f"has numbers of the type {kind!r} and the format {form!r}, which are not known")
    if not dimensions or not all(re.fullmatch("[0-9]{1,15}", one) for one in dimensions):
        raise ReadError(f"is not a readable xdmf file: the Dimensions of a data item are {' '.join(dimensions)!r}")
    if said(element, "Compression") not in ("", "raw"):
        raise ReadError("has compressed binary numbers, which meshfix does not read")
    # Of text that tells no precision no digit is lost.
    size = int(precision or (8 if form == "xml" else _SIZES.get(kind, 4)))
    if said(element, "Endian") not in _ORDERS:
        raise ReadError(f"has numbers in the byte order {said(element, 'Endian')!r}, which is not known")
    dtype = np.dtype(f"{_ORDERS[said(element, 'Endian')]}{_KINDS[kind]}{size}")
    shape = tuple(map(int, dimensions))
    if form == "xml":
        return Item(element, form, dtype, shape)
    text = tree.data[element.begin : element.end].decode("utf-8", "replace").strip()
    if not text.isprintable():
        raise ReadError("is not a readable xdmf file: the name of a file beside it is more than a line")
    if form == "hdf":
        name, _, path = text.rpartition(":")
        if not name.strip() or not path.strip():
            raise ReadError(f"is not a readable xdmf file: {text!r} names no data set in a file")
        return Item(element, form, dtype, shape, normpath(unescape(name.strip())), path.strip())
    seek = said(element, "Seek") or "0"
    if not text or not seek.isdecimal():
        raise ReadError("is not a readable xdmf file: binary numbers have no file or no offset")
    return Item(element, form, dtype, shape, normpath(unescape(text)), seek=int(seek))


def files_named(tree: Tree) -> list[tuple[str, int, int]]:
    """Return the name of the file that has the numbers of each data item, and where the name stands."""
    found = []
    for element in tree.select("//DataItem"):
        form, text = said(element, "Format"), tree.data[element.begin : element.end]
        if form in ("hdf", "hdf5", "binary") and text.strip() and not element.attributes.get("Reference"):
            name = text.rpartition(b":")[0] if form != "binary" else text
            begin = element.begin + len(name) - len(name.lstrip())
            found.append(
                (normpath(unescape(name.strip().decode("utf-8", "replace"))), begin, begin + len(name.strip()))
            )
    return found


@dataclass(frozen=True, eq=False)
class Contents:
    """The contents of a file, and of those beside it.

    Attributes
    ----------
    data : bytes
    beside : callable
        Gives the content of a file that this one names.
    others : dict
        The contents of those that were asked for, in this order.
    """

    data: bytes
    beside: Beside
    others: dict[str, bytes] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """The names of the files that were read."""
        return list(self.others)

    @cached_property
    def joined(self) -> bytes:
        """All of them, one behind the other; there may be no more then."""
        return b"".join([self.data, *self.others.values()]) if self.others else self.data

    def start(self, name: str) -> int:
        """Return where one begins among the joined."""
        return (
            len(self.data) + sum(len(self.others[one]) for one in takewhile(lambda one: one != name, self.others))
            if name
            else 0
        )

    def of_file(self, name: str) -> bytes:
        """Return the content of one; empty: this file."""
        if name and name not in self.others:
            self.others[name] = self.beside(name)
        return self.others[name] if name else self.data

    def read(self, item: Item, data: bool = False) -> NDArray[Any]:
        """Return numbers (size,) in the machine's byte order.

        Of `data` the file beside tells the type: dolfinx says none of its tags, which are whole numbers.

        Raises
        ------
        ReadError
            There are more or fewer, or others.
        """
        content = self.of_file(item.file)
        if item.form == "hdf":
            with naming(item.file), hdf5.opened(content, "HDF5") as root:
                return hdf5.numbers(_found(root, item), "f" if item.dtype.kind == "f" and not data else "iuf").ravel()
        if item.form == "binary":
            with naming(item.file):
                return self._raw(item).read(content).ravel()
        if item.dtype.kind == "f":
            return numbers_at(self.data, self._words(item), item.dtype)
        values, end = self._in_text(item, short_integers)
        self._check_end(item, end)
        return values

    def places(self, item: Item) -> Places | None:
        """Return where numbers (size, 1) stand in the joined files; None: they are compressed."""
        if item.form == "xml":
            return Places.of_text(self._words(item)[:, None], item.dtype.newbyteorder("=").str)
        if item.form == "binary":
            places: Places | None = self._raw(item)
        else:
            content = self.of_file(item.file)
            with naming(item.file), hdf5.opened(content, "HDF5") as root:
                places = Table([_found(root, item).name], np.arange(item.size)[:, None]).places(root)
        return None if places is None else replace(places, begin=places.begin + self.start(item.file))

    def _raw(self, item: Item) -> Places:
        if item.size * item.dtype.itemsize + item.seek > len(self.of_file(item.file)):
            raise ReadError("is truncated: it ends before its last number")
        return Places.of_rows(item.seek + item.dtype.itemsize * np.arange(item.size), 1, item.dtype.str)

    def _words(self, item: Item) -> NDArray[np.int64]:
        spans, begin = self._in_text(item, lambda text, at, count: (words(text, at, count), at))
        spans = spans + (item.element.begin - begin)
        self._check_end(item, int(spans.max(initial=item.element.begin)) - item.element.begin)
        return spans

    def _in_text(self, item: Item, read: Callable[[bytes, int, int], Any]) -> Any:
        """Return what (text, offset, count) gives for the text of an item, which may end with a number."""
        begin, end = item.element.begin, item.element.end
        if item.size > end - begin:
            raise in_line(self.data, item.element.at, f"{item.size:,} numbers are announced, and there are fewer")
        try:
            return read(self.data[begin:end], 0, item.size)
        except ReadError:
            read(self.data[:end], begin, item.size)  # which tells the line
            raise

    def _check_end(self, item: Item, end: int) -> None:
        if self.data[item.element.begin + end : item.element.end].strip():
            raise in_line(self.data, item.element.at, f"{item.size:,} numbers are announced, and there are more")


def _found(root: Any, item: Item) -> Any:
    found = hdf5.data_set(root, item.path)
    if found is None:
        raise ReadError(f"there is no data set {item.path!r} in it")
    if found.size != item.size:
        raise ReadError(f"its {hdf5.name_of(found)} has {found.size:,} numbers for {item.size:,}")
    return found
