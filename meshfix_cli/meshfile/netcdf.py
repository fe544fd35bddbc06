"""Files of netCDF in its classic forms, CDF-1, CDF-2 and CDF-5: the variables, and where their numbers stand.

A header tells names, types and shapes, and the offset of each variable, whose big-endian numbers stand there as they
are. What has a value for each record, of which there may be any number, stands record by record behind all others.

Source: Unidata, "NetCDF Classic Format Specification"; PnetCDF, "CDF-5 format specification".
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError

MAGIC = (b"CDF\1", b"CDF\2", b"CDF\5")
_TYPES = {
    1: ">i1", 2: "S1", 3: ">i2", 4: ">i4", 5: ">f4", 6: ">f8", 7: ">u1", 8: ">u2", 9: ">u4", 10: ">i8", 11: ">u8",
}  # fmt: skip
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12
_LONGEST_UNPADDED = 2  # bytes of a number whose records have no gaps, where no other variable has records


@dataclass(frozen=True, eq=False)
class Variable:
    """A table of numbers or characters.

    Attributes
    ----------
    data : bytes
        All of the file.
    name : str
    shape : tuple of int
        The number of records first, where there are any.
    dtype : numpy dtype
    begin : int
        Offset of the first value.
    record : int
        Bytes from one record to the next; 0: it has none.
    attributes : mapping
        Numbers as arrays, and texts.
    """

    data: bytes = field(repr=False)
    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    begin: int
    record: int
    attributes: Mapping[str, Any]

    @property
    def end(self) -> int:
        """The offset behind the last value."""
        if 0 in self.shape:
            return self.begin
        if not self.record:
            return self.begin + math.prod(self.shape) * self.dtype.itemsize
        return self.begin + (self.shape[0] - 1) * self.record + math.prod(self.shape[1:]) * self.dtype.itemsize

    def text(self, name: str) -> str:
        """Return an attribute, which is a text; empty: there is none."""
        return str(self.attributes.get(name, ""))

    def values(self) -> NDArray[Any]:
        """Return all values in the machine's byte order."""
        return self._view().astype(self.dtype.newbyteorder("="))

    def last(self) -> NDArray[Any]:
        """Return the values of the last record in the machine's byte order."""
        return self._view()[-1].astype(self.dtype.newbyteorder("="))

    def offsets(self) -> NDArray[np.int64]:
        """Return where each value begins."""
        size = self.dtype.itemsize
        if not self.record or not self.shape:
            return (self.begin + size * np.arange(math.prod(self.shape), dtype=np.int64)).reshape(self.shape)
        inner = size * np.arange(math.prod(self.shape[1:]), dtype=np.int64)
        each = self.begin + self.record * np.arange(self.shape[0], dtype=np.int64)[:, None] + inner
        return each.reshape(self.shape)

    def _view(self) -> NDArray[Any]:
        if 0 in self.shape:
            return np.empty(self.shape, self.dtype)
        if not self.record:
            return np.frombuffer(self.data, self.dtype, math.prod(self.shape), self.begin).reshape(self.shape)
        inner = np.ndarray(self.shape[1:], self.dtype, self.data, self.begin)
        return np.lib.stride_tricks.as_strided(inner, self.shape, (self.record, *inner.strides), writeable=False)


class _Header:
    """What is read from the beginning of a file, number by number."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 4
        self.count = ">Q" if data[3] == 5 else ">I"
        self.offset = ">I" if data[3] == 1 else ">Q"

    def number(self, form: str = ">I") -> int:
        size = struct.calcsize(form)
        return int(struct.unpack(form, self.take(size))[0])

    def take(self, size: int) -> bytes:
        """The next bytes."""
        if size > len(self.data) - self.at:
            raise ReadError("is truncated: its header reaches behind its end")
        self.at += size
        return self.data[self.at - size : self.at]

    def padded(self, size: int) -> bytes:
        """The next bytes, which fill words of four."""
        return self.take(size + -size % 4)[:size]

    def name(self) -> str:
        return self.padded(self.number(self.count)).decode("utf-8", "replace")

    def entries(self, tag: int) -> range:
        """The numbers of the entries of a list."""
        found, size = self.number(), self.number(self.count)
        if found != tag and (found, size) != (0, 0):
            raise ReadError("is not a readable netCDF file: its header is damaged")
        if size > (len(self.data) - self.at) // 8:  # the least that an entry takes
            raise ReadError("is truncated: its header announces more than it holds")
        return range(size)

    def attributes(self) -> dict[str, Any]:
        return {self.name(): self._attribute() for _ in self.entries(_ATTRIBUTES)}

    def _attribute(self) -> Any:
        dtype, size = self.type(), self.number(self.count)
        values = self.padded(size * dtype.itemsize)
        if dtype.kind == "S":
            return values.decode("utf-8", "replace").partition("\0")[0].strip()
        return np.frombuffer(values, dtype).astype(dtype.newbyteorder("="))

    def type(self) -> np.dtype[Any]:
        number = self.number()
        if number not in _TYPES:
            raise ReadError(f"is not a readable netCDF file: it has values of type {number}")
        return np.dtype(_TYPES[number])


def parse(data: bytes) -> dict[str, Variable]:
    """Return the variables by their names; ReadError where the header is damaged, or tells of more than there is."""
    head = _Header(data)
    records = head.number(head.count)
    sizes = {i: (head.name(), head.number(head.count))[1] for i in head.entries(_DIMENSIONS)}
    head.attributes()
    found = [_variable(head, sizes) for _ in head.entries(_VARIABLES)]
    varying = [one for one in found if one.record]
    if len(varying) == 1 and varying[0].dtype.itemsize <= _LONGEST_UNPADDED:
        step = math.prod(varying[0].shape[1:]) * varying[0].dtype.itemsize
    else:
        step = sum(one.record for one in varying)
    if varying and records in (2**32 - 1, 2**64 - 1):  # it was written to a stream, and its end tells
        records = (len(data) - min(one.begin for one in varying)) // step if step else 0
    variables = {one.name: replace(one, shape=(records, *one.shape[1:]), record=step) for one in varying}
    variables |= {one.name: one for one in found if not one.record}
    for one in variables.values():
        if one.end > len(data):
            raise ReadError(f"is truncated: its {one.name!r} reaches behind its end")
    return variables


def _variable(head: _Header, sizes: Mapping[int, int]) -> Variable:
    """Read what tells of a variable; `record` is the bytes that one of its records takes."""
    name = head.name()
    dimensions = [head.number(head.count) for _ in range(_few(head, head.number(head.count)))]
    attributes, dtype = head.attributes(), head.type()
    head.number(head.count)  # its size, which cannot tell that of large ones
    begin = head.number(head.offset)
    if not all(one in sizes for one in dimensions):
        raise ReadError(f"is not a readable netCDF file: {name!r} has a dimension that is not there")
    shape = tuple(sizes[one] for one in dimensions)
    if 0 in shape[1:]:
        raise ReadError(f"is not a readable netCDF file: the records are not the first dimension of {name!r}")
    record = 0
    if shape[:1] == (0,):
        size = math.prod(shape[1:]) * dtype.itemsize
        record = size + -size % 4
    return Variable(head.data, name, shape, dtype, begin, record, attributes)


def _few(head: _Header, count: int) -> int:
    if count > (len(head.data) - head.at) // 4:
        raise ReadError("is truncated: its header announces more than it holds")
    return count
