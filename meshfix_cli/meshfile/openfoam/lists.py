"""What the files of OpenFOAM's meshes hold: lists of numbers behind a header, in text or binary.

Source: OpenFOAM User Guide, "Basic input/output file format" and "Mesh files"; OpenFOAM, "UListIO.C", "faceIOList.H".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.splice import Places
from meshfix_cli.meshfile.tables import Int64, rows, without
from meshfix_cli.meshfile.text import in_line, integers, short_integers

Labels = NDArray[np.int32] | NDArray[np.int64]

_HEADER = re.compile(rb"FoamFile\s*\{([^}]*)\}")
_ENTRY = re.compile(rb"(\w+)\s+(\"[^\"]*\"|[^;]*);")
_BLANK = re.compile(rb"(?:\s|//[^\n]*|/\*(?s:.*?)\*/)*")
_COUNT = re.compile(rb"(\d{1,18})\s*([({])")
_NAME = re.compile(rb"\s*(\"[^\"]*\"|[^\s{}();\"]+)\s*\{")
_TOKEN = re.compile(rb"[{}]|List<(label|bool)>\s*(\d{1,18})\s*([({])")
_COMMENT = re.compile(rb"//[^\n]*|/\*.*?\*/", re.DOTALL)


@dataclass(frozen=True, eq=False)
class File:
    """A file of a mesh.

    Attributes
    ----------
    data : bytes
        Of a text, with blanks in the place of comments among what it lists.
    begin : int
        The offset behind the header.
    kind : str
        The class of what it holds.
    binary : bool
    order : {"<", ">"}
    label, scalar : int
        Bytes of a binary integer and real.
    """

    data: bytes
    begin: int
    kind: str
    binary: bool
    order: str
    label: int
    scalar: int

    @classmethod
    def of(cls, data: bytes) -> File:
        """Read the header."""
        header = _HEADER.search(data, 0, 65536)
        if header is None:
            raise ReadError("is not a readable file of OpenFOAM: it has no header")
        entries = {name.decode(): value.strip().decode("latin-1") for name, value in _ENTRY.findall(header[1])}
        sizes = dict(re.findall(r"(label|scalar)=(\d+)", entries.get("arch", "")))
        label, scalar = (int(sizes.get(name, usual)) for name, usual in (("label", 32), ("scalar", 64)))
        if not {label, scalar} <= {32, 64}:
            raise ReadError(f"has labels of {label} and scalars of {scalar} bits, and 32 or 64 are read")
        binary = entries.get("format", "ascii") == "binary"
        return cls(
            data if binary else _without_comments(data, header.end()), header.end(), entries.get("class", ""), binary,
            ">" if "MSB" in entries.get("arch", "") else "<",
            label // 8, scalar // 8,
        )  # fmt: skip

    def labels(self, at: int | None = None) -> tuple[Labels, int]:
        """Read a list of integers (k,), here or at an offset, and return the offset behind it."""
        count, begin, uniform = self._list(self.begin if at is None else at)
        if uniform:
            value, end = integers(self.data.replace(b"}", b" "), begin, 1)
            return np.full(count, value[0]), self._closed(end, b"}")
        if not self.binary:
            values, end = short_integers(self.data, begin, count, brackets=True)
            return values, self._closed(end)
        found = np.frombuffer(self.data, f"{self.order}i{self.label}", self._claimed(count, begin, self.label), begin)
        return found.astype(found.dtype.newbyteorder("="), copy=False), self._closed(begin + found.nbytes)

    def vectors(self) -> Places:
        """Find the places (n, 3) of a list of vectors."""
        count, begin, _ = self._list(self.begin)
        if not self.binary:
            spans, end = rows(self.data, begin, count, 3, brackets=True)
            self._closed(end)
            return Places.of_text(spans)
        size = 3 * self.scalar
        self._closed(begin + size * self._claimed(count, begin, size))
        return Places.of_rows(begin + size * np.arange(count), 3, f"{self.order}f{self.scalar}")

    def faces(self) -> tuple[Labels, Labels]:
        """Read a list of lists: offsets (f+1,) and vertices (k,)."""
        if self.kind == "faceCompactList":
            offsets, end = self.labels()
            vertices, _ = self.labels(end)
            if not len(offsets) or offsets[0] != 0 or offsets[-1] != len(vertices) or (np.diff(offsets) < 0).any():
                raise ReadError("is not a readable file of OpenFOAM: the offsets of its faces do not fit")
            return offsets, vertices
        count, begin, _ = self._list(self.begin)
        offsets, vertices, end, good = kernels.read_integer_lists(self.data, begin, count)
        if not good:
            raise in_line(self.data, end + 1, f"there are not {counted(count, 'list', 'lists')} of integers")
        self._closed(end)
        return offsets, vertices

    def blocks(self) -> Iterator[tuple[str, bytes, Int64]]:
        """Give the names of the dictionaries of a list, what each holds up to a list of its own, and the first such."""
        count, at, _ = self._list(self.begin)
        for _ in range(count):
            name = _NAME.match(self.data, at)
            if name is None:
                raise ReadError(f"is truncated: it announces {counted(count, 'entry', 'entries')}")
            begin = end = at = name.end()
            found, depth = np.empty(0, dtype=np.int64), 1
            while depth:
                token = _TOKEN.search(self.data, at)
                if token is None:
                    raise ReadError("is truncated: an entry does not end")
                if token[1] == b"label":
                    values, at = self.labels(token.start(2))
                    found, end = (values.astype(np.int64), token.start()) if end == begin else (found, end)
                elif token[1]:
                    at = self._behind_bools(token)
                else:
                    at = token.end()
                    depth += 1 if token[0] == b"{" else -1
            yield name[1].strip(b'"').decode("latin-1"), self.data[begin : end if end > begin else at], found
        self._closed(at)

    def _behind_bools(self, token: re.Match[bytes]) -> int:
        uniform = token[3] == b"{"
        at = token.end() + (int(token[2]) if self.binary and not uniform else 0)
        end = self.data.find(b"}" if uniform else b")", at) + 1
        return end or len(self.data)

    def _list(self, at: int) -> tuple[int, int, bool]:
        """Return how many things a list announces, the offset of the first, and whether that stands for all."""
        begin = _BLANK.match(self.data, at)
        match = _COUNT.match(self.data, begin.end()) if begin else None
        if match is None:
            raise in_line(self.data, at, "there is no list")
        return int(match[1]), match.end(), match[2] == b"{"

    def _claimed(self, count: int, begin: int, size: int) -> int:
        if count * size > len(self.data) - begin:
            raise ReadError(f"is truncated: {counted(count, 'thing is', 'things are')} announced")
        return count

    def _closed(self, at: int, brackets: bytes = b")") -> int:
        """Return the offset behind the end of a list."""
        for bracket in brackets:
            at += len(self.data[at : at + 65536]) - len(self.data[at : at + 65536].lstrip())
            if self.data[at : at + 1] != bytes([bracket]):
                raise (
                    in_line(self.data, at, "a list does not end where it should")
                    if at < len(self.data)
                    else (ReadError("is truncated: a list does not end"))
                )
            at += 1
        return at


def _without_comments(data: bytes, begin: int) -> bytes:
    """Return the data with blanks in the place of comments, if there are some between the brackets of its list."""
    first = _BLANK.match(data, begin)
    at = data.find(b"/", first.end() if first else begin, max(0, data.rfind(b")")))
    return without(data, _COMMENT) if at >= 0 else data
