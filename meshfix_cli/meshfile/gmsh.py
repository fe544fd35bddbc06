"""Coordinates in gmsh's .msh files, versions 2 and 4.1, ASCII and binary.

Source: the chapter "MSH file format" of gmsh's reference manual.
"""

from __future__ import annotations

import re
import struct

import numpy as np

from meshfix_cli.meshfile.splice import Places, Span, binary_places, text_places

_LINE = re.compile(rb"[^\n]*\n")
_XYZ = re.compile(rb"[ \t]*(\S+)[ \t]+(\S+)[ \t]+(\S+)[^\n]*\n")
_TAG_XYZ = re.compile(rb"[ \t]*\S+[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)[^\n]*\n")


def find_coordinates(data: bytes) -> Places | None:
    """Find the nodes in their order in the file; None: not in the form this module knows."""
    header = re.search(rb"\$MeshFormat\s+(\S+)\s+([01])\s+8[^\n]*\n(.{4})?", data, re.DOTALL)
    section = data.find(b"\n$Nodes")
    if header is None or section < 0:
        return None
    start = data.index(b"\n", section + 1) + 1
    order = "<" if header[3] == struct.pack("<i", 1) else ">"
    reader = {
        (b"2", b"0"): _text_2, (b"2", b"1"): _binary_2, (b"4.1", b"0"): _text_4, (b"4.1", b"1"): _binary_4,
    }.get((header[1].split(b".")[0] if header[1].startswith(b"2") else header[1], header[2]))  # fmt: skip
    return reader(data, start, order) if reader else None


def _text_2(data: bytes, at: int, order: str) -> Places | None:
    """A line `tag x y z` for each node, after their number."""
    del order
    count, at = _integers(data, at)
    spans, _ = _matches(_TAG_XYZ, data, at, count[0])
    return text_places(spans, "f8")


def _binary_2(data: bytes, at: int, order: str) -> Places | None:
    """An int and three doubles for each node, after a line with their number."""
    count, at = _integers(data, at)
    return binary_places(at + 4 + 28 * np.arange(count[0], dtype=np.int64), f"{order}f8")


def _text_4(data: bytes, at: int, order: str) -> Places | None:
    """Blocks: a line `dimension entity parametric count`, the tags, then `x y z`, with u v w behind if parametric."""
    del order
    (blocks, *_), at = _integers(data, at)
    spans: list[Span] = []
    for _ in range(blocks):
        (_, _, _, count), at = _integers(data, at)
        for _ in range(count):
            at = data.index(b"\n", at) + 1
        found, at = _matches(_XYZ, data, at, count)
        if len(found) < count:
            return None
        spans += found
    return text_places(spans, "f8")


def _binary_4(data: bytes, at: int, order: str) -> Places | None:
    """The same with ints, size_t and doubles."""
    (blocks, *_) = struct.unpack_from(f"{order}4Q", data, at)
    at += 32
    first = []
    for _ in range(blocks):
        dimension, _, parametric, count = struct.unpack_from(f"{order}3iQ", data, at)
        at += 20 + 8 * count
        width = 8 * (3 + (dimension if parametric else 0))
        first.append(at + width * np.arange(count, dtype=np.int64))
        at += width * count
    return binary_places(np.concatenate(first), f"{order}f8") if first else None


def _integers(data: bytes, at: int) -> tuple[list[int], int]:
    line = _LINE.match(data, at)
    return ([int(word) for word in line[0].split()], line.end()) if line else ([0], at)


def _matches(pattern: re.Pattern[bytes], data: bytes, at: int, count: int) -> tuple[list[Span], int]:
    """Match a pattern `count` times in a row; the spans of its three groups, and the offset behind."""
    spans = []
    for _ in range(count):
        match = pattern.match(data, at)
        if match is None:
            break
        spans.append((*match.span(1), *match.span(2), *match.span(3)))
        at = match.end()
    return spans, at
