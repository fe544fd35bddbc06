"""Blocks of elements of an Exodus file: their names and numbers, and runs of cells.

Source: L. A. Schoof, V. R. Yarberry, "EXODUS II: a finite element data model", SAND92-2137, sections 4.8 and A.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.exodus.types import ORDER, POLYGON, POLYHEDRON, key_of
from meshfix_cli.meshfile.exodus.variables import Variable

Int64 = NDArray[np.int64]
_CONNECTIVITY = re.compile(r"(connect|facconn)([1-9]\d*)")
_POLYGONS = {3: "triangle", 4: "quad"}  # what those of so many nodes are


Named = Mapping[str, Variable]


@dataclass(frozen=True, eq=False)
class Run:
    """Elements of one type with the same number of nodes.

    Attributes
    ----------
    type : str
    vertices : (m, k) int, or a list of arrays
        In the order of the table of elements.
    rows : (m,) int64
        Which elements of the block they are.
    at : callable
        Gives where in the table of the block each vertex (m, k) stands.
    """

    type: str
    vertices: Any
    rows: Int64
    at: Callable[[], Int64]


@dataclass(frozen=True, eq=False)
class Block:
    """A block of elements, of which there may be none.

    Attributes
    ----------
    number : int
        That which the file gives to it.
    table : str
        The name of the variable that has its nodes.
    type : str
        What it calls its elements.
    first, size : int
        How many elements stand before it, and in it.
    runs : sequence of Run
    """

    number: int
    table: str
    type: str
    first: int
    size: int
    runs: tuple[Run, ...]


def blocks(variables: Named, dimension: int) -> list[Block]:
    """Read the blocks that have elements, in the order of the file; ReadError where their tables do not fit."""
    ids = numbers(variables, "eb_prop1")
    found: list[Block] = []
    tables = (_CONNECTIVITY.fullmatch(name) for name in variables)
    for table in sorted((one for one in tables if one), key=lambda one: int(one[2])):
        at = int(table[2])
        first = found[-1].first + found[-1].size if found else 0
        title = variables[table[0]].text("elem_type").partition("\0")[0].strip()
        runs = tuple(_runs(variables, table[0], table[2], title, dimension))
        number = int(ids[at - 1]) if at <= len(ids) else at
        found.append(Block(number, table[0], title, first, sum(len(run.rows) for run in runs), runs))
    return found


def numbers(variables: Named, name: str) -> Int64:
    """Return the integers (k,) of a variable; none where there is no such variable."""
    if name not in variables:
        return np.empty(0, dtype=np.int64)
    found = variables[name].values()
    if found.dtype.kind not in "iu":
        raise ReadError(f"is not a readable exodus file: its {name!r} are not integers")
    return found.ravel().astype(np.int64)


def titles(variables: Named, name: str) -> list[str]:
    """Return the texts of a variable, one a row; none where there is no such variable."""
    found = variables[name].values() if name in variables else np.empty(0, dtype="S1")
    if found.dtype.kind != "S" or found.ndim != 2:
        return []
    return [row.tobytes().partition(b"\0")[0].decode("utf-8", "replace").strip() for row in found]


def _runs(variables: Named, table: str, number: str, title: str, dimension: int) -> Iterator[Run]:
    nodes = variables[table].values()
    if nodes.dtype.kind not in "iu":
        raise ReadError(f"is not a readable exodus file: its {table!r} are not integers")
    if title.lower() in (POLYGON, POLYHEDRON):
        counts = numbers(variables, f"ebepecnt{number}")
        if (counts < 0).any() or counts.sum() != nodes.size:
            raise ReadError(f"is not a readable exodus file: the counts of {table!r} do not add up")
        yield from (_polyhedra if title.lower() == POLYHEDRON else _polygons)(variables, nodes.ravel(), counts)
        return
    if nodes.ndim != 2:
        raise ReadError(f"is not a readable exodus file: its {table!r} is no table")
    if len(nodes):
        key = key_of(title, nodes.shape[1], dimension)
        order = ORDER.get(key)
        vertices = _from_zero(nodes if order is None else nodes[:, order])
        yield Run(key, vertices, np.arange(len(nodes)), partial(_all, nodes.shape[0], nodes.shape[1], order))


def _all(rows: int, columns: int, order: Sequence[int] | None) -> Int64:
    at = np.arange(rows * columns).reshape(rows, columns)
    return at if order is None else at[:, order]


def _from_zero(nodes: NDArray[Any]) -> NDArray[Any]:
    """Return nodes, which the file numbers from 1, as rows."""
    if nodes.dtype != np.int32:
        return nodes.astype(np.int64) - 1
    return nodes - np.int32(1) if nodes.size == 0 or nodes.min() > np.iinfo(np.int32).min else nodes


def _polygons(_: Named, nodes: NDArray[Any], counts: Int64) -> Iterator[Run]:
    starts = np.cumsum(counts) - counts
    for size in np.unique(counts).tolist():
        rows = np.flatnonzero(counts == size)
        at = starts[rows][:, None] + np.arange(size)
        yield Run(_POLYGONS.get(size, "polygon"), _from_zero(nodes[at]), rows, partial(np.copy, at))


def _polyhedra(variables: Named, faces: NDArray[Any], counts: Int64) -> Iterator[Run]:
    """Elements that name their faces, which are in blocks of their own; a vertex stands there once for each face."""
    tables = sorted(int(name[6:]) for name in variables if re.fullmatch(r"fbconn[1-9]\d*", name))
    nodes = np.concatenate([numbers(variables, f"fbconn{i}") for i in tables] or [counts[:0]])
    sizes = np.concatenate([numbers(variables, f"fbepecnt{i}") for i in tables] or [counts[:0]])
    mine = faces.astype(np.int64) - 1
    if (sizes < 0).any() or sizes.sum() != len(nodes) or not ((mine >= 0) & (mine < len(sizes))).all():
        raise ReadError("is not a readable exodus file: an element has a face that is not there")
    each = sizes[mine]
    if each.sum() > len(nodes) * 2 + len(mine):  # a face has two sides
        raise ReadError("is not a readable exodus file: a face has more than two elements")
    begin = np.repeat((np.cumsum(sizes) - sizes)[mine] - (np.cumsum(each) - each), each)
    vertices = nodes[begin + np.arange(len(begin))] - 1
    ends = np.concatenate([[0], np.cumsum(each)])[np.cumsum(counts)]
    yield Run(
        "polyhedron",
        np.split(vertices, ends[:-1]),
        np.arange(len(counts)),
        partial(np.copy, np.empty((0, 0), np.int64)),
    )
