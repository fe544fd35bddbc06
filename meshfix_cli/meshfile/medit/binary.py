"""MEDIT's binary files, .meshb: keywords by their numbers, each with the offset of the next.

Behind the number 1, which tells the order of bytes, and a version from 1 to 4 come the keywords, the first of which is
the dimension. Offsets have 64 bits from version 3 on, all counts and integers in version 4; in version 1 coordinates
are in single precision, and in others where a keyword says so.

Source: L. Maréchal, "libmeshb7.c" and "Handling unstructured meshes and solutions: libMeshb".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.medit.sections import CELLS, Section, check_dimension, columns_of, source_of
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.splice import Places

_MARKS = {b"\1\0\0\0": "<", b"\0\0\0\1": ">"}
_DIMENSION, _VERTICES, _END, _BEZIER, _PRECISION = 3, 4, 54, 125, 155
_NAMES = {
    _VERTICES: "Vertices", 5: "Edges", 6: "Triangles", 7: "Quadrilaterals", 8: "Tetrahedra", 9: "Prisms",
    10: "Hexahedra", 13: "Corners", 14: "Ridges", 15: "RequiredVertices", 16: "RequiredEdges",
    17: "RequiredTriangles", 18: "RequiredQuadrilaterals", 19: "TangentAtEdgeVertices", 20: "NormalAtVertices",
    21: "NormalAtTriangleVertices", 24: "TrianglesP2", 25: "EdgesP2", 27: "QuadrilateralsQ2", 30: "TetrahedraP2",
    33: "HexahedraQ2", 47: "Polyhedra", 48: "Polygons", 49: "Pyramids", 59: "Tangents", 60: "Normals",
    61: "TangentAtVertices", 86: "PrismsP2", 87: "PyramidsP2", 88: "QuadrilateralsQ3", 89: "QuadrilateralsQ4",
    90: "TrianglesP3", 91: "TrianglesP4", 92: "EdgesP3", 93: "EdgesP4", 96: "TetrahedraP3", 97: "TetrahedraP4",
    _BEZIER: "BezierBasis", 127: "EdgesP2Ordering", 128: "EdgesP3Ordering", 129: "TrianglesP2Ordering",
    130: "TrianglesP3Ordering", 131: "QuadrilateralsQ2Ordering", 132: "QuadrilateralsQ3Ordering",
    133: "TetrahedraP2Ordering", 134: "TetrahedraP3Ordering", 135: "PyramidsP2Ordering", 137: "PrismsP2Ordering",
    139: "HexahedraQ2Ordering", 141: "EdgesP1Ordering", 142: "EdgesP4Ordering", 143: "TrianglesP1Ordering",
    144: "TrianglesP4Ordering", 145: "QuadrilateralsQ1Ordering", 146: "QuadrilateralsQ4Ordering",
    147: "TetrahedraP1Ordering", 148: "TetrahedraP4Ordering", 149: "PyramidsP1Ordering", 151: "PrismsP1Ordering",
    153: "HexahedraQ1Ordering",
}  # fmt: skip
_VECTORS = (59, 60)  # of as many numbers as coordinates
_OF_INTEGERS = ("Ridges", "TangentAtEdgeVertices", "NormalAtVertices", "NormalAtTriangleVertices", "TangentAtVertices")


class _Words(NamedTuple):
    """How a file holds its numbers."""

    order: str
    version: int

    @property
    def offset(self) -> str:
        return f"{self.order}i{4 if self.version < 3 else 8}"

    @property
    def integer(self) -> str:
        return f"{self.order}i{4 if self.version < 4 else 8}"

    @property
    def real(self) -> str:
        return f"{self.order}f{4 if self.version == 1 else 8}"


class _Block(NamedTuple):
    """A keyword by its number, where it stands, where what follows it begins, and where that ends."""

    number: int
    at: int
    begin: int
    end: int

    @property
    def name(self) -> str:
        return _NAMES.get(self.number, f"keyword {self.number}")


def parse(data: bytes) -> Source:
    """Read vertices and cells."""
    return source_of(data, list(_sections(data)))


def promoted(data: bytes) -> bytes:
    """Return the file with coordinates in double precision: it becomes one of version 2."""
    words = _words(data)
    if words.version > 1 or _real(data, list(_blocks(data, words)), words) != words.real:
        return data
    dimension, parts, at = 0, [data[:4], _bytes(2, f"{words.order}i4")], 8
    for block in _blocks(data, words):
        if block.number == _DIMENSION:
            dimension = _integer(data, block.begin, f"{words.order}i4")
        body = _widened(data, block, words, dimension)
        at += block.begin - block.at + len(body)
        last = block.number == _END or not _integer(data, block.at + 4, words.offset)
        parts += [data[block.at : block.at + 4], _bytes(0 if last else at, words.offset), body]
    return b"".join(parts)


def _widened(data: bytes, block: _Block, words: _Words, dimension: int) -> bytes:
    """Return what follows a keyword with its numbers in double precision."""
    body = data[block.begin : block.end]
    integers = block.name in _OF_INTEGERS or block.number in (_DIMENSION, _END, _BEZIER)
    if integers or (block.number != _VERTICES and columns_of(block.name, dimension)):
        return body
    if block.number != _VERTICES and block.number not in _VECTORS:
        raise ReadError(f"has a section ({block.name}) that may hold numbers in single precision, so it stays so")
    count = _count(data, block, words, dimension * 4 + 4 * (block.number == _VERTICES))
    more = [("ref", words.integer)] if block.number == _VERTICES else []
    kinds = [np.dtype([("x", f"{words.order}{real}", (dimension,)), *more]) for real in ("f4", "f8")]
    begin = block.begin + np.dtype(words.integer).itemsize
    with np.errstate(invalid="ignore"):  # a signalling nan becomes a quiet one
        rows = np.frombuffer(data, kinds[0], count, begin).astype(kinds[1])
    return data[block.begin : begin] + rows.tobytes() + data[begin + count * kinds[0].itemsize : block.end]


def _words(data: bytes) -> _Words:
    order = _MARKS.get(data[:4], "")
    if not order:
        raise ReadError("is not a readable medit file: it does not begin with the number 1")
    words = _Words(order, _integer(data, 4, f"{order}i4"))
    if not 1 <= words.version <= 4:
        raise ReadError(f"is not a readable medit file: its version is {words.version}")
    return words


def _blocks(data: bytes, words: _Words) -> Iterator[_Block]:
    """Give the keywords in their order, with End where there is one."""
    at, size = 8, np.dtype(words.offset).itemsize
    while True:
        number, following = _integer(data, at, f"{words.order}i4"), _integer(data, at + 4, words.offset)
        begin = at + 4 + size
        end = following if following and number != _END else len(data)
        if not begin <= end <= len(data):
            raise ReadError(f"is truncated or not readable: a keyword ({number}) ends at the byte {end:,}")
        yield _Block(number, at, begin, end)
        if end == len(data) and (number == _END or not following):
            return
        at = end


def _sections(data: bytes) -> Iterator[Section]:
    words, dimension = _words(data), 0
    blocks = list(_blocks(data, words))
    real = _real(data, blocks, words)
    for block in blocks:
        if block.number == _DIMENSION:
            dimension = _integer(data, block.begin, f"{words.order}i4")
            check_dimension(dimension)
        elif block.number == _VERTICES or columns_of(block.name, dimension):
            yield _section(data, block, words, dimension if block.number == _VERTICES else 0, real)
        elif block.number not in (_END, _PRECISION):
            yield Section(block.name)


def _real(data: bytes, blocks: Sequence[_Block], words: _Words) -> str:
    """Return the type of coordinates."""
    for block in (one for one in blocks if one.number == _PRECISION):
        bits = _integer(data, block.begin + np.dtype(words.integer).itemsize, words.integer)
        if bits not in (32, 64):
            raise ReadError(f"is not a readable medit file: its numbers have {bits} bits")
        return f"{words.order}f{bits // 8}"
    return words.real


def _section(data: bytes, block: _Block, words: _Words, coordinates: int, real: str) -> Section:
    """Read a section with so many coordinates in front of its integers."""
    if block.number == _VERTICES and not coordinates:
        raise ReadError("is not a readable medit file: the dimension does not stand before the vertices")
    name, columns = block.name, columns_of(block.name, coordinates)
    kind = np.dtype([("x", real, (coordinates,)), ("i", words.integer, (columns,))])
    count = _count(data, block, words, kind.itemsize)
    begin = block.begin + np.dtype(words.integer).itemsize
    rows = np.frombuffer(data, kind, count, begin)["i"].astype(np.int64)
    first = begin + kind.itemsize * np.arange(count)
    if coordinates:
        return Section(name, rows, partial(Places.of_rows, first, coordinates, real))
    return Section(name, rows, partial(Places.of_rows, first, columns - 1, words.integer) if name in CELLS else None)


def _count(data: bytes, block: _Block, words: _Words, size: int) -> int:
    count = _integer(data, block.begin, words.integer)
    if not 0 <= count * size <= block.end - block.begin - np.dtype(words.integer).itemsize:
        raise ReadError(f"is truncated: {block.name} announces {counted(count, 'row', 'rows')}")
    return count


def _integer(data: bytes, at: int, kind: str) -> int:
    if at + np.dtype(kind).itemsize > len(data):
        raise ReadError("is truncated: it ends where a keyword should stand")
    return int(np.frombuffer(data, kind, 1, at)[0])


def _bytes(value: int, kind: str) -> bytes:
    return np.array(value, dtype=kind).tobytes()
