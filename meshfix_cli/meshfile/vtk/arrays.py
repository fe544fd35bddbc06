"""How VTK's XML files encode arrays of numbers: as text, raw or in base64, and these plain or compressed in blocks.

An encoded array is a header of integers and the numbers: the header is the number of bytes, or, where they are
compressed, the number of blocks, the size of a block, that of the last block (0: as the others), and the size of each
block when compressed. In base64 the header is encoded by itself if there are blocks, else together with the numbers.

Source: VTK, "vtkXMLDataParser.cxx" and "vtkXMLWriter.cxx".
"""

from __future__ import annotations

import zlib
from base64 import b64decode, b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.splice import Edits, Places, apply
from meshfix_cli.meshfile.text import Spans, integers_at, numbers_at, words

_BLANKS = b" \t\r\n"
_LZMA_MEMORY = 1 << 27  # enough for its highest level


class Compressor(NamedTuple):
    """A way to compress blocks.

    Attributes
    ----------
    most : int
        How many bytes can come out of one, at most.
    compress : callable
    decompress : callable
        Gives the number of bytes that it is told, or another number of bytes where they are not in the block.
    """

    most: int
    compress: Callable[[bytes], bytes]
    decompress: Callable[[bytes, int], bytes]


@dataclass(frozen=True)
class Coding:
    """How a file encodes its numbers.

    Attributes
    ----------
    order : "<" or ">"
    width : int
        Bytes of an integer in the headers.
    compressor : Compressor or None
    base64 : bool
    """

    order: str
    width: int
    compressor: Compressor | None
    base64: bool

    def integers(self, header: bytes) -> list[int]:
        """Return the integers of a header."""
        return np.frombuffer(header, dtype=f"{self.order}u{self.width}").tolist()

    def header(self, integers: Sequence[int]) -> bytes:
        """Return a header of some integers."""
        if max(integers) >> 8 * self.width:
            raise ReadError("has an array that is too large for its headers of UInt32")
        return np.array(integers, dtype=f"{self.order}u{self.width}").tobytes()

    def text(self, data: bytes) -> bytes:
        """Return bytes as the file holds them."""
        return b64encode(data) if self.base64 else data


class Kind(NamedTuple):
    """What an array should be: its name, the type of its numbers in numpy's words, and how many they are."""

    name: str
    dtype: str
    size: int

    @property
    def bytes(self) -> int:
        """How many bytes the numbers take."""
        return self.size * np.dtype(self.dtype).itemsize


@dataclass(frozen=True, eq=False)
class Text:
    """An array of numbers that stand as text in a file.

    Attributes
    ----------
    body : bytes
        The file.
    begin, end : int
        The text in it.
    kind : Kind
    """

    body: bytes
    begin: int
    end: int
    kind: Kind

    @cached_property
    def spans(self) -> Spans:
        """(size, 2) int64: the words."""
        text, (name, _, size) = self.body[self.begin : self.end], self.kind
        numbers = counted(size, "number", "numbers")
        try:
            spans = words(text, 0, size)
        except ReadError as error:
            raise ReadError(f"is truncated: its array {name!r} has less than {numbers}") from error
        if text[spans.max(initial=0) :].strip():
            raise ReadError(f"is not a readable VTK file: its array {name!r} has more than {numbers}")
        return spans + self.begin

    def read(self) -> NDArray[Any]:
        """Return the numbers (size,), integers in int64."""
        if self.kind.dtype[0] == "f":
            return numbers_at(self.body, self.spans, np.dtype(self.kind.dtype))
        return integers_at(self.body, self.spans)

    def places(self, which: NDArray[np.int64]) -> Places:
        """Where some numbers (n, k) of the array stand in the body."""
        return Places.of_text(self.spans[which], self.kind.dtype)

    def edited(self, edits: Edits) -> Edits:
        """Return the edits of the file that make those of the body."""
        return edits


class _Stored(NamedTuple):
    """The numbers of an encoded array, and how they were encoded.

    `end` is where the array ends, `block` and `last` are the sizes of blocks in the header, `joint` tells that the
    header is encoded together with the numbers.
    """

    body: bytes
    end: int
    blocks: Sequence[bytes] = ()
    block: int = 0
    last: int = 0
    joint: bool = False


@dataclass(frozen=True, eq=False)
class Payload:
    """An array of numbers that is encoded.

    Attributes
    ----------
    file : bytes
    begin, end : int
        The array in it, with its header.
    kind : Kind
    coding : Coding
    stored : _Stored
    """

    file: bytes
    begin: int
    end: int
    kind: Kind
    coding: Coding
    stored: _Stored

    @classmethod
    def inline(cls, file: bytes, begin: int, end: int, kind: Kind, coding: Coding) -> Payload:
        """Decode an array that is all of a text in base64, with blanks wherever they are."""
        text = file[begin:end]
        first, last = end - len(text.lstrip(_BLANKS)), begin + len(text.rstrip(_BLANKS))
        text = text.translate(None, _BLANKS)
        stored = _decode(_Stream(text, 0, len(text), coding.base64, kind.name), kind.bytes, coding)
        if kind.size and stored.end != len(text):
            raise ReadError(f"is not a readable VTK file: its array {kind.name!r} has more bytes than announced")
        return cls(file, first, last, kind, coding, stored)

    @classmethod
    def appended(cls, file: bytes, begin: int, end: int, kind: Kind, coding: Coding) -> Payload:
        """Decode an array that begins, and does not reach behind `end`."""
        stored = _decode(_Stream(file, begin, end, coding.base64, kind.name), kind.bytes, coding)
        return cls(file, begin, stored.end, kind, coding, stored)

    @property
    def body(self) -> bytes:
        """The numbers."""
        return self.stored.body

    @property
    def dtype(self) -> np.dtype[Any]:
        """Their type, with its byte order."""
        return np.dtype(self.coding.order + self.kind.dtype)

    def read(self) -> NDArray[Any]:
        """Return the numbers (size,)."""
        return np.frombuffer(self.body, dtype=self.dtype).astype(self.kind.dtype)

    def places(self, which: NDArray[np.int64]) -> Places:
        """Where some numbers (n, k) of the array stand in the body."""
        return Places(which * self.dtype.itemsize, None, self.dtype)

    def edited(self, edits: Edits) -> Edits:
        """Return the edit of the file that makes those of the body."""
        return self._replaced(apply(self.body, [edits]))

    def widened(self) -> Edits:
        """Return the edit of the file that makes numbers in float32 those in float64."""
        with np.errstate(invalid="ignore"):  # a signalling nan becomes a quiet one
            numbers = np.frombuffer(self.body, dtype=self.dtype).astype(f"{self.coding.order}f8")
        return self._replaced(numbers.tobytes())

    def _replaced(self, body: bytes) -> Edits:
        """Return the edit of the file that gives it another body, a multiple as long."""
        text, old = self._encoded(body), self.file[self.begin : self.end]
        if self.coding.base64 and len(text) < len(old):  # keep the blanks between
            characters = np.frombuffer(old, dtype=np.uint8).copy()
            filled = ~np.isin(characters, list(_BLANKS))
            if np.count_nonzero(filled) == len(text):
                characters[filled] = np.frombuffer(text, dtype=np.uint8)
                text = characters.tobytes()
        return replacement(self.begin, self.end, text)

    def _encoded(self, body: bytes) -> bytes:
        text, header = self.coding.text, self.coding.header
        if self.stored.joint:
            return text(header([len(body)]) + body)
        if self.coding.compressor is None:
            return text(header([len(body)])) + text(body)
        scale, size = len(body) // len(self.body), self.stored.block
        before = (self.body[at : at + size] for at in range(0, len(self.body), size))
        after = (body[at : at + scale * size] for at in range(0, len(body), scale * size))
        blocks = [
            block if new == old else self.coding.compressor.compress(new)
            for block, old, new in zip(self.stored.blocks, before, after, strict=True)
        ]
        sizes = [scale * size, scale * self.stored.last, *map(len, blocks)]
        return text(header([len(blocks), *sizes])) + text(b"".join(blocks))


Numbers = Text | Payload


def replacement(begin: int, end: int, text: bytes) -> Edits:
    """Return the edit that puts a text in the place of what stands from `begin` to `end`."""
    return Edits(np.array([[begin, end]], dtype=np.int64), text, np.array([[0, len(text)]], dtype=np.int64))


@dataclass
class _Stream:
    """Takes the next bytes of an encoded array called `name` from a text that ends at `end`."""

    text: bytes
    at: int
    end: int
    base64: bool
    name: str

    def peek(self, count: int) -> bytes:
        """Return the next bytes, in base64 up to two more."""
        stop = self._behind(count)
        if stop > self.end:
            raise ReadError(f"is truncated: its array {self.name!r} ends before it should")
        chunk = self.text[self.at : stop]
        try:
            chunk = b64decode(chunk, validate=True) if self.base64 else chunk
        except ValueError as error:
            raise ReadError(f"is not a readable VTK file: its array {self.name!r} is not base64") from error
        if len(chunk) < count:
            raise ReadError(f"is truncated: its array {self.name!r} ends before it should")
        return chunk

    def take(self, count: int) -> bytes:
        """Return the next bytes, and go behind them."""
        chunk = self.peek(count)
        self.at = self._behind(count)
        return chunk[:count]

    def _behind(self, count: int) -> int:
        return self.at + (4 * ((count + 2) // 3) if self.base64 else count)


def _decode(stream: _Stream, size: int, coding: Coding) -> _Stored:
    """Decode an array of `size` bytes."""
    first = stream.peek(coding.width)
    (number,) = coding.integers(first[: coding.width])
    if coding.compressor is not None:
        return _decompress(stream, number, size, coding, coding.compressor)
    _check(stream.name, number, size)
    if coding.base64 and len(first) == coding.width:  # the header by itself, as some programs write it
        stream.take(coding.width)
        return _Stored(stream.take(size), stream.at)
    return _Stored(stream.take(coding.width + size)[coding.width :], stream.at, joint=True)


def _decompress(stream: _Stream, number: int, size: int, coding: Coding, compressor: Compressor) -> _Stored:
    """Decode an array in a number of blocks."""
    if number == 0:
        _check(stream.name, 0, size)
        return _Stored(b"", stream.at)
    _, block, last, *lengths = coding.integers(stream.take(coding.width * (3 + number)))
    sizes = [block] * (number - 1) + [last or block]
    _check(stream.name, sum(sizes), size)
    if not 0 < sizes[-1] <= block:
        raise ReadError(f"is not a readable VTK file: the last block of its array {stream.name!r} has a wrong size")
    ends = list(accumulate(lengths, initial=0))
    compressed = stream.take(ends[-1])
    blocks = [compressed[first:last] for first, last in pairwise(ends)]
    body = b"".join(_opened(block, size, compressor, stream.name) for block, size in zip(blocks, sizes, strict=True))
    return _Stored(body, stream.at, blocks, block, last)


def _check(name: str, announced: int, size: int) -> None:
    if announced != size:
        problem = "is truncated" if announced < size else "is not a readable VTK file"
        raise ReadError(f"{problem}: its array {name!r} has {counted(announced, 'byte', 'bytes')}, not {size:,}")


def _opened(block: bytes, size: int, compressor: Compressor, name: str) -> bytes:
    """Return the bytes of a block."""
    try:
        body = compressor.decompress(block, size) if size <= compressor.most * len(block) else b""
    except ImportError as error:
        raise ReadError(f"is not a readable VTK file: its compression needs the package {error.name}") from error
    except (zlib.error, ValueError) as error:
        raise ReadError(f"is not a readable VTK file: a block of its array {name!r} is damaged ({error})") from error
    if len(body) != size:
        raise ReadError(f"is not a readable VTK file: a block of its array {name!r} is not as long as announced")
    return body


def _bounded(stream: Any, block: bytes, size: int) -> bytes:
    """Let a stream decompress a block; nothing where it holds more than `size` bytes."""
    body = stream.decompress(block, size + 1)
    return body if stream.eof else b""


def _zlib_decompress(block: bytes, size: int) -> bytes:
    return _bounded(zlib.decompressobj(), block, size)


# These two are imported when a file needs them: not everybody has them.
def _lzma_decompress(block: bytes, size: int) -> bytes:
    lzma = import_module("lzma")
    try:
        return _bounded(lzma.LZMADecompressor(memlimit=_LZMA_MEMORY), block, size)
    except lzma.LZMAError as error:
        raise ValueError(error) from error


def _lz4_decompress(block: bytes, size: int) -> bytes:
    lz4 = import_module("lz4.block")
    try:
        return lz4.decompress(block, uncompressed_size=size)
    except lz4.LZ4BlockError as error:
        raise ValueError(error) from error


COMPRESSORS = {
    "vtkZLibDataCompressor": Compressor(1040, zlib.compress, _zlib_decompress),
    "vtkLZ4DataCompressor": Compressor(
        255, lambda body: import_module("lz4.block").compress(body, store_size=False), _lz4_decompress
    ),
    "vtkLZMADataCompressor": Compressor(10_000, lambda body: import_module("lzma").compress(body), _lzma_decompress),
}
