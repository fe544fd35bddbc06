"""The sections of a .msh file, read one after the other: nodes, elements, entities, and where data are."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.gmsh.cells import TYPES
from meshfix_cli.meshfile.gmsh.numbers import Binary, Int64, Text
from meshfix_cli.meshfile.splice import Places

_SECTION = re.compile(rb"(?:^|\A\xef\xbb\xbf)\$(?!End|END)(\w{0,60})[^\n]*(?:\n|\Z)", re.MULTILINE)
_END = re.compile(rb"\s*\$(?:End|END)(\w+)")
_FORMAT = re.compile(rb"\s*(\d+(?:\.\d+)?)[ \t]+([01])[ \t]+(\d+)[^\n]*\n")
_NAME = re.compile(rb'^\s*(\d)\s+(-?\d{1,18})\s+"([^\n]*)"', re.MULTILINE)
_AFFINE = re.compile(rb"\s*Affine\b[^\n]*\n")
_TOLD = ("MeshFormat", "PhysicalNames", "Nodes", "Elements", "NodeData", "ElementData", "NOD", "NOE", "ELM")
Numbers = Text | Binary
_Readers = Mapping[str, Callable[[Any, "File"], None]]


class UnknownError(Exception):
    """The file is of a kind that this module does not read."""


class Block(NamedTuple):
    """Elements of one type: numbers (m,), nodes (m, k), entities (m,), and the places of the nodes.

    Version 4.1 tells the physical groups (m,) of the entity, which has the dimension; here they are None.
    """

    kind: int
    ids: Int64
    nodes: Int64
    entities: Int64
    physical: Int64 | None
    dimension: int
    corners: Callable[[], Places]

    @property
    def entity(self) -> tuple[int, int]:
        """The dimension and the number of the entity that all elements belong to, in version 4.1."""
        return self.dimension, int(self.entities[0])


@dataclass
class File:
    """What is found while going from section to section.

    Attributes
    ----------
    tags : list of (n,) int64
        Numbers of the nodes.
    coordinates : list of Places
    blocks : list of Block
    groups : dict
        The physical groups of each entity, which is a dimension and a number.
    interfaces : set
        Entities that lie between partitions of another of a higher dimension.
    shadows : set of int
        Numbers of the entities that hold ghost elements.
    partitions : int
        Into how many the mesh is cut.
    titles : list of (int, int, str)
        Dimension, number and name of each group that has one.
    views : list
        Sections of data, by the name of the section, and what reads their numbers.
    untold : dict
        What no other format holds.
    parametric : bool
        Whether nodes have parameters of the curve or face on which they lie.
    first : bool
        Whether it is of version 1.
    periodic : list of int64
        Numbers of nodes that have a copy elsewhere, or are one, as where a mesh is periodic.
    """

    tags: list[Int64] = field(default_factory=list)
    coordinates: list[Places] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    groups: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    interfaces: set[tuple[int, int]] = field(default_factory=set)
    shadows: set[int] = field(default_factory=set)
    partitions: int = 0
    titles: list[tuple[int, int, str]] = field(default_factory=list)
    views: list[tuple[str, Numbers]] = field(default_factory=list)
    untold: dict[str, None] = field(default_factory=dict)
    parametric: bool = False
    first: bool = False
    periodic: list[Int64] = field(default_factory=list)

    def ghosts(self, block: Block) -> NDArray[np.bool_] | None:
        """Mark all elements (m,) of a block that belongs to another partition."""
        here = block.dimension >= 0 and block.entity[1] in self.shadows and block.entity not in self.groups
        return np.ones(len(block.ids), dtype=bool) if here else None


def read(data: bytes) -> File:
    """Go from section to section; those that are not known end where their name says so.

    Raises
    ------
    ReadError
        The file is damaged.
    UnknownError
        This module does not read its kind.
    """
    numbers: Numbers | None = None
    readers: _Readers = {}
    file, at = File(), 0
    while match := _SECTION.search(data, at):
        name, at = match[1].decode("latin-1"), match.end()
        if name not in _TOLD:
            file.untold["comments" if name == "Comments" else f"section ${name}"] = None
        if numbers is None and name in _READERS[1]:
            numbers, readers, file.first = Text(data, at), _READERS[1], True
        if name in readers and numbers is not None:
            numbers.at = at
            readers[name](numbers, file)
            at = _behind(data, numbers.at, name)
            continue
        begin, at = at, _end_of(data, match[1], at)
        if at < 0 and numbers is None and name not in ("MeshFormat", "Comments"):
            break
        if at < 0:
            raise ReadError(f"is truncated: the section ${name} does not end")
        if name == "MeshFormat":
            numbers, readers = _format(data, begin)
        elif name == "PhysicalNames":
            found = _NAME.findall(data[begin:at])
            file.titles += [
                (int(dimension), int(number), title.decode("utf-8", "replace")) for dimension, number, title in found
            ]
        elif name in ("NodeData", "ElementData") and numbers is not None:
            file.views.append((name, replace(numbers, at=begin)))
        at += 1
    _leave_out_interfaces(file)
    if numbers is None:
        raise ReadError("is not a readable gmsh file: it has no $MeshFormat, and no $NOD as those of version 1")
    return file


def _end_of(data: bytes, name: bytes, at: int) -> int:
    """Return where a section ends that stands at an offset: some programs put no line break behind binary numbers.

    -1: it does not end.
    """
    for end in (b"\n$End", b"\n$END", b"$End"):
        found = data.find(end + name, at - 1)
        if found >= 0:
            return found
    return -1


def _leave_out_interfaces(file: File) -> None:
    """Elements between partitions are none of the mesh: they would hold nodes that are inside of a volume."""
    inner = [block for block in file.blocks if block.dimension < 0 or block.entity not in file.interfaces]
    if len(inner) < len(file.blocks):
        file.untold["elements between partitions"] = None
        file.blocks = inner


def _behind(data: bytes, at: int, name: str) -> int:
    """Go over the end of a section that is where its numbers end."""
    match = _END.match(data, at)
    if match is None or match[1].decode("latin-1") != name:
        raise ReadError(f"is truncated or damaged: $End{name} does not stand behind what ${name} announces")
    return match.end()


def _format(data: bytes, at: int) -> tuple[Numbers, _Readers]:
    match = _FORMAT.match(data, at)
    if match is None:
        raise ReadError("is not a readable gmsh file: $MeshFormat does not tell a version, a type and a size")
    version, binary, size = float(match[1]), match[2] == b"1", int(match[3][:9])
    if not (2 <= version < 3 or version == 4.1):
        raise ReadError(f"is of gmsh's version {match[1].decode()}, which is not read: save it as 2.2 or 4.1")
    if binary and size not in ((8,) if version < 3 else (4, 8)):
        raise UnknownError
    readers = _READERS[int(version)]
    if not binary:
        return Text(data, match.end()), readers
    one = data[match.end() : match.end() + 4]
    if one not in (b"\1\0\0\0", b"\0\0\0\1"):
        raise ReadError("is not a readable gmsh file: $MeshFormat does not tell the order of the bytes")
    return Binary(data, match.end(), "<" if one[0] else ">", f"u{size}"), readers


def _nodes_2(numbers: Numbers, file: File) -> None:
    """Read their number, and a row of tag, x, y and z for each."""
    tags, places = numbers.tagged(numbers.count(), 3)
    file.tags.append(tags)
    file.coordinates.append(places)


def _parametric_nodes_2(numbers: Numbers, file: File) -> None:
    """Read their number, and for each tag, x, y, z, dimension and entity, and one parameter on curves, two on faces."""
    file.parametric = True
    tags, places = numbers.parametric(numbers.count())
    file.tags.append(tags)
    file.coordinates.append(places)


def _nodes_4(numbers: Numbers, file: File) -> None:
    """Read blocks: dimension, entity, whether there are parameters; tags, then x, y, z and the parameters."""
    for _ in range(int(numbers.sizes(4)[0])):
        dimension, _, parametric = numbers.ints(3).tolist()
        if dimension not in range(4) or parametric not in (0, 1):
            raise ReadError("is not a readable gmsh file: a block of $Nodes has no header")
        count = int(numbers.sizes(1)[0])
        file.parametric |= bool(parametric)
        file.tags.append(numbers.sizes(count))
        file.coordinates.append(numbers.coordinates(count, 3 + dimension * parametric))


def _elements_4(numbers: Numbers, file: File) -> None:
    """Read blocks: dimension, entity, type; a row of tag and nodes for each element."""
    for _ in range(int(numbers.sizes(4)[0])):
        dimension, entity, kind = numbers.ints(3).tolist()
        count, base = int(numbers.sizes(1)[0]), numbers.at
        width = 1 + _nodes_of(kind)
        table = numbers.sizes(count * width).reshape(count, width)
        if count:
            corners = partial(numbers.corners, base, 1 + width * np.arange(count), width - 1, numbers.size)
            entities = np.full(count, entity)
            file.blocks.append(Block(kind, table[:, 0], table[:, 1:], entities, None, dimension, corners))


def _elements_2(numbers: Numbers, file: File) -> None:
    """Read rows of tag, type, number of labels, labels and nodes; in binary, headers stand before several rows.

    The labels are a physical group, an entity, and partitions.
    """
    count = numbers.count()
    base, flat, own = numbers.at, numbers.all_integers(), int(numbers.binary)
    heads, used = _heads(flat, count, numbers.binary)
    if numbers.binary:
        numbers.at += 4 * used
    elif used < len(flat):
        raise _too_many(count)
    kinds = flat[heads + 1 - own]
    for kind in dict.fromkeys(kinds.tolist()):
        begin, size = heads[kinds == kind], _nodes_of(kind)
        together = flat[begin + 1].astype(np.int64) if own else np.ones_like(begin)
        labels = flat[begin + 2].astype(np.int64)
        if labels.max() > 2:
            file.untold["partitions"] = None
        # In binary the tag stands behind the head.
        first = _spread(begin, together, own + labels + size) + 3 + own + np.repeat(labels, together)
        labels = np.repeat(labels, together)
        ids = flat[first - labels - 3 + 2 * own].astype(np.int64)
        nodes = flat[first[:, None] + np.arange(size)].astype(np.int64)
        physical, entities = (
            np.where(labels > i, flat[first - np.maximum(labels - i, 0)], 0).astype(np.int64) for i in range(2)
        )
        corners = partial(numbers.corners, base, first, size, "i4")
        file.blocks.append(Block(kind, ids, nodes, entities, physical, -1, corners))


def _elements_1(numbers: Numbers, file: File) -> None:
    """Read rows of tag, type, physical group, entity, number of nodes and nodes."""
    count = numbers.count()
    base, flat = numbers.at, numbers.all_integers()
    heads = _heads_1(flat, count)
    kinds = flat[heads + 1]
    for kind in dict.fromkeys(kinds.tolist()):
        begin, size = heads[kinds == kind], _nodes_of(kind)
        ids, _, physical, entities, sizes = (flat[begin + i].astype(np.int64) for i in range(5))
        if (sizes != size).any():
            element = ids[sizes != size][0]
            raise ReadError(f"is not a readable gmsh file: the element {element} has not {size} nodes")
        nodes = flat[begin[:, None] + 5 + np.arange(size)].astype(np.int64)
        corners = partial(numbers.corners, base, begin + 5, size, "i4")
        file.blocks.append(Block(kind, ids, nodes, entities, physical, -1, corners))


def _heads_1(flat: NDArray[Any], count: int) -> Int64:
    """Where the rows of elements stand, of which each tells how many nodes it has."""
    numbers, at = flat.astype(flat.dtype.newbyteorder("=")).data, 0
    heads: list[int] = []
    while len(heads) < count:
        if at + 5 > len(numbers) or not 0 < numbers[at + 4] <= len(numbers) - at - 5:
            raise _too_few(count, count - len(heads))
        heads.append(at)
        at += 5 + numbers[at + 4]
    if at < len(numbers):
        raise _too_many(count)
    return np.array(heads, dtype=np.int64)


def _heads(flat: NDArray[Any], count: int, binary: bool) -> tuple[Int64, int]:
    """Where the heads of elements stand, and where the last of them ends; in text each element has its own."""
    numbers, heads, at, left = flat.astype(flat.dtype.newbyteorder("=")).data, [], 0, count
    while left > 0:
        if at + 3 > len(numbers):
            raise _too_few(count, left)
        kind, together, labels = numbers[at], numbers[at + 1], numbers[at + 2]
        if not binary:
            kind, together = together, 1
        step = 3 + together * (binary + labels + _nodes_of(kind))
        if labels < 0 or not 0 < together <= left or step > len(numbers) - at:
            raise _too_few(count, left)
        heads.append(at)
        at, left = at + step, left - together
    return np.array(heads, dtype=np.int64), at


def _too_few(count: int, left: int) -> ReadError:
    return ReadError(f"is truncated: $Elements announces {_elements(count)} and holds {count - left:,}")


def _too_many(count: int) -> ReadError:
    return ReadError(f"is not a readable gmsh file: $Elements announces {_elements(count)} and holds more")


def _elements(count: int) -> str:
    return counted(count, "element", "elements")


def _spread(begin: Int64, count: Int64, step: Int64) -> Int64:
    """Join what begins somewhere and goes on `count` times by a step."""
    ends = np.cumsum(count)
    inside = np.arange(ends[-1]) - np.repeat(ends - count, count)
    return np.repeat(begin, count) + np.repeat(step, count) * inside


def _nodes_of(kind: int) -> int:
    if kind not in TYPES:  # no other reader knows more of them
        raise ReadError(
            f"has elements of the type {kind}, which is not known, or an element with too few or too many numbers"
        )
    return TYPES[kind][1]


def _entities(numbers: Numbers, file: File, partitioned: bool) -> None:
    """Read the entities: tag, what it is a part of, box, physical groups, boundary."""
    if partitioned:
        file.partitions = int(numbers.sizes(1)[0])
        file.shadows.update(numbers.ints(2 * int(numbers.sizes(1)[0]))[::2].tolist())
    for dimension, count in enumerate(numbers.sizes(4).tolist()):
        for _ in range(count):
            tag = int(numbers.ints(1)[0])
            if partitioned:
                if numbers.ints(2)[0] > dimension:
                    file.interfaces.add((dimension, tag))
                numbers.ints(int(numbers.sizes(1)[0]))
            numbers.coordinates(1, 6 if dimension else 3)
            groups = numbers.ints(int(numbers.sizes(1)[0]))
            file.groups[dimension, tag] = tuple(np.abs(groups).tolist())  # the sign is an orientation
            if dimension:
                numbers.ints(int(numbers.sizes(1)[0]))


def _periodic_2(numbers: Numbers, file: File) -> None:
    """Read pairs of nodes, which are text in binary files as well: entities, maybe a transformation, and the pairs."""
    text = Text(numbers.data, numbers.at)
    for _ in range(text.count()):
        text.ints(3)
        if match := _AFFINE.match(text.data, text.at):
            text.at = match.end()
        file.periodic.append(text.ints(2 * text.count()))
    numbers.at = text.at


def _periodic_4(numbers: Numbers, file: File) -> None:
    """Read pairs of nodes: entities, the numbers of a transformation, and the pairs."""
    for _ in range(int(numbers.sizes(1)[0])):
        numbers.ints(3)
        if count := int(numbers.sizes(1)[0]):
            numbers.coordinates(1, count)
        file.periodic.append(numbers.sizes(2 * int(numbers.sizes(1)[0])))


_READERS: dict[int, _Readers] = {
    1: {"NOD": _nodes_2, "NOE": _nodes_2, "Nodes": _nodes_2, "ELM": _elements_1, "Elements": _elements_1},
    2: {
        "Nodes": _nodes_2,
        "ParametricNodes": _parametric_nodes_2,
        "Elements": _elements_2,
        "Periodic": _periodic_2,
    },
    4: {
        "Nodes": _nodes_4,
        "Elements": _elements_4,
        "Entities": partial(_entities, partitioned=False),
        "PartitionedEntities": partial(_entities, partitioned=True),
        "Periodic": _periodic_4,
    },
}
