"""The files that an Abaqus .inp includes, outside of its steps: they are read as if their lines stood in it.

Source: Dassault Systèmes, "Abaqus Keywords Reference Guide", *INCLUDE.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.splice import InPlace, Points, Turned
from meshfix_cli.meshfile.together import Together

_LINE = re.compile(rb"(?im)^[ \t]*\*(INCLUDE|STEP|END[ \t]*STEP)\b([^\n]*)(?:\n|\Z)")
_INCLUDE = re.compile(rb"\*INCLUDE", re.IGNORECASE)
_INPUT = re.compile(rb",\s*INPUT?\s*=\s*(\"[^\"]*\"|[^,\s]+)", re.IGNORECASE)
_GLUE = -1  # the end of a last line that has none


def inclusions(data: bytes) -> list[tuple[int, int, int]]:
    """Find the lines that include a file outside of steps: where its name begins and ends, and where the line ends.

    Raises
    ------
    ReadError
        One names no file.
    """
    found, within = [], False
    for line in _LINE.finditer(data) if _INCLUDE.search(data) else ():
        if line[1].upper() != b"INCLUDE":
            within = line[1].upper() == b"STEP"
        elif not within:
            named = _INPUT.search(data, line.start(2), line.end(2))
            if named is None:
                raise ReadError("uses *INCLUDE without INPUT=")
            found.append((*named.span(1), line.end()))
    return found


def _renamed(data: bytes, names: Mapping[str, str]) -> bytes:
    """Return a file that includes others under other names."""
    parts, at = [], 0
    for begin, end, _ in inclusions(data):
        word = data[begin:end]
        name = os.fsencode(names[_name(word)])
        quote = b'"' if word.startswith(b'"') or re.search(rb"[\s,]", name) else b""
        parts += [data[at:begin], quote, name, quote]
        at = end
    return b"".join([*parts, data[at:]])


def _name(word: bytes) -> str:
    return os.fsdecode(word.strip(b'"'))


@dataclass
class _Joined:
    """Files one within another: whose each piece of the text is, by the position of its name."""

    beside: Callable[[str], bytes]
    names: list[str] = field(default_factory=list)
    owners: list[int] = field(default_factory=list)
    pieces: list[bytes] = field(default_factory=list)

    def add(self, name: str, data: bytes) -> None:
        """Take a file and all that it includes; ReadError where one is included twice."""
        if name in self.names:
            raise ReadError(f"includes {name} twice")
        me, at = len(self.names), 0
        self.names.append(name)
        for begin, end, behind in inclusions(data):
            self._put(me, data[at:behind])
            if not data.endswith(b"\n", at, behind):
                self._put(_GLUE, b"\n")
            at = behind
            self.add(_name(data[begin:end]), self.beside(_name(data[begin:end])))
        self._put(me, data[at:])
        if not data.endswith(b"\n"):
            self._put(_GLUE, b"\n")

    def _put(self, owner: int, piece: bytes) -> None:
        self.owners.append(owner)
        self.pieces.append(piece)

    def divided(self, parts: Sequence[bytes]) -> list[bytes]:
        """Return the files whose pieces are these."""
        owned: list[list[bytes]] = [[] for _ in self.names]
        for owner, part in zip(self.owners, parts, strict=True):
            if owner != _GLUE:
                owned[owner].append(part)
        return [b"".join(mine) for mine in owned]


def read_together(
    data: bytes, path: Path | None, parse: Callable[[bytes], Source], given: dict[str, bytes] | None = None
) -> Source:
    """Read a file with those that it includes, `given` ones as they are there."""

    def beside(name: str) -> bytes:
        if given is not None:
            return given[name]
        if path is None:
            raise ReadError(f"includes {name}, which is beside it, so it is read from its file and not from a stream")
        try:
            return (path.parent / name).read_bytes()
        except (OSError, ValueError) as error:
            raise ReadError(f"includes {name}: {getattr(error, 'strerror', None) or 'cannot be read'}") from error

    joined = _Joined(beside)
    joined.add("", data)
    source = parse(b"".join(joined.pieces))
    layout = source.layout
    assert isinstance(layout, InPlace)
    bounds = list(accumulate(map(len, joined.pieces)))[:-1]

    def written(original: Points, points: Points, turned: Mapping[int, Turned]) -> list[bytes]:
        return joined.divided(layout.divided(original, points, turned, bounds))

    def again(contents: Sequence[bytes]) -> Source:
        return read_together(contents[0], path, parse, dict(zip(joined.names[1:], contents[1:], strict=True)))

    def renamed(contents: list[bytes], names: Sequence[str]) -> list[bytes]:
        return [_renamed(one, dict(zip(joined.names[1:], names[1:], strict=True))) for one in contents]

    assert path is not None  # else nothing would be beside it
    paths = [path, *(path.parent / name for name in joined.names[1:])]
    return replace(source, layout=None, pieces=Together(path, paths, layout, written, again, renamed=renamed))
