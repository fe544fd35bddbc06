"""What an Exodus file has beside blocks: sets of nodes, sides and elements, and fields.

Source: L. A. Schoof, V. R. Yarberry, "EXODUS II: a finite element data model", SAND92-2137, sections 4.9 to 4.12.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.exodus.blocks import Block, Int64, Named, numbers, titles
from meshfix_cli.meshfile.exodus.types import ORDER, sides_of
from meshfix_cli.meshfile.source import REGIONS, Arrays

BLOCK = "exodus:block"


def arrays(variables: Named, found: Sequence[Block], points: int, dimension: int) -> Arrays:
    """Return blocks as regions and groups, sets, and the fields of the last time step."""
    runs = [(block, run) for block in found for run in block.runs]
    cell: dict[str, Sequence[NDArray[Any]]] = dict(_vectors(dict(_fields_of_cells(variables, found))))
    labels = {name: [_whole(values) for values in cell[name]] for name in regions_of(list(cell)) if name in cell}
    blocks = {BLOCK: [np.full(len(run.rows), block.number) for block, run in runs]}
    of_points = {name: [values] for name, values in _fields_of_points(variables, points)}
    groups = dict(_groups(variables, found, dimension))
    sets = dict(_cell_sets(variables, found))
    if labels:  # the numbers of which blocks have not
        of_blocks = {
            name: [np.arange(len(run.rows) if block.number == number else 0) for block, run in runs]
            for name, (number, _) in groups.items()
        }
        groups, sets = {}, {**of_blocks, **sets}
    return Arrays(
        {name: values for name, (values,) in _vectors(of_points).items()},
        {**cell, **blocks, **labels},
        groups,
        _point_sets(variables, found, dimension),
        sets,
    )


def regions_of(names: Sequence[str]) -> tuple[str, ...]:
    """Return what tells materials apart: blocks, if no field does under a name that only such have."""
    return tuple(name for name in REGIONS if name in names) or (BLOCK,)


def _whole(values: NDArray[Any]) -> NDArray[Any]:
    """Return labels, which fields hold as reals."""
    whole = (values == np.round(values)) & (np.abs(values) < 2**53)
    return values.astype(np.int64) if whole.all() else values


def _vectors(fields: Mapping[str, Sequence[NDArray[Any]]]) -> dict[str, list[NDArray[Any]]]:
    """Return fields, in runs, with those as one whose names end in _x, _y and, if there is one, _z."""
    found: dict[str, list[NDArray[Any]]] = {}
    for name in fields:
        stem, end = name[:-2], name[-2:]
        ends = [one for one in ("_x", "_y", "_z") if stem + one in fields]
        if end not in ends or ends[:2] != ["_x", "_y"] or stem in fields:
            found[name] = list(fields[name])
        elif end == "_x":
            columns = zip(*(fields[stem + one] for one in ends), strict=True)
            found[stem] = [np.column_stack(of_run) for of_run in columns]
    return found


def _groups(variables: Named, found: Sequence[Block], dimension: int) -> Iterator[tuple[str, list[int]]]:
    """Names of blocks, if need be of their numbers, each with that and the dimension of its elements."""
    named = titles(variables, "eb_names")
    for block in found:
        at = int(re.sub(r"\D", "", block.table)) - 1
        if block.runs:
            name = named[at] if at < len(named) else ""
            yield name or f"block_{block.number}", [block.number, dimension_of(block.runs[0].type)]


def _sets(variables: Named, kind: str, table: str, default: str) -> Iterator[tuple[str, str]]:
    """Names and numbers of the sets of a kind that are not empty."""
    ids, named = numbers(variables, f"{kind}_prop1"), titles(variables, f"{kind}_names")
    found = (re.fullmatch(rf"{table}([1-9]\d*)", name) for name in variables)
    for number in sorted(int(one[1]) for one in found if one):
        at = number - 1
        name = named[at] if at < len(named) else ""
        yield name or f"{default}_{ids[at] if at < len(ids) else number}", str(number)


def _point_sets(variables: Named, found: Sequence[Block], dimension: int) -> dict[str, Int64]:
    """Sets of nodes, and the vertices of sets of sides; those of one name are one."""
    sets: dict[str, Int64] = {}
    for name, number in _sets(variables, "ns", "node_ns", "nodelist"):
        sets[name] = np.union1d(sets.get(name, np.empty(0, np.int64)), numbers(variables, f"node_ns{number}") - 1)
    for name, number in _sets(variables, "ss", "elem_ss", "surface"):
        elements, sides = numbers(variables, f"elem_ss{number}"), numbers(variables, f"side_ss{number}")
        if elements.shape != sides.shape:
            raise ReadError(f"is not a readable exodus file: the side set {name!r} has elements without sides")
        parts = [_on_sides(block, elements - 1 - block.first, sides, dimension) for block in found]
        sets[name] = np.unique(np.concatenate([sets.get(name, np.empty(0, np.int64)), *parts]))
    return sets


def _on_sides(block: Block, rows: Int64, sides: Int64, dimension: int) -> Int64:
    """Return the vertices on sides of elements, by their rows in a block, of which some may be in others."""
    if len(block.runs) != 1 or not isinstance(block.runs[0].vertices, np.ndarray):
        return np.empty(0, dtype=np.int64)  # those of polygons and polyhedra have no numbers of their own
    run = block.runs[0]
    mine = (rows >= 0) & (rows < block.size)
    rows, sides = rows[mine], sides[mine]
    order = np.argsort(ORDER.get(run.type, range(run.vertices.shape[1])))  # of the file's nodes in the run
    parts = [
        run.vertices[rows[sides == side]][:, order[list(nodes)]].ravel().astype(np.int64)
        for side, nodes in enumerate(sides_of(run.type, block.type, dimension), 1)
    ]
    return np.concatenate([np.empty(0, dtype=np.int64), *parts])


def _cell_sets(variables: Named, found: Sequence[Block]) -> Iterator[tuple[str, list[Int64]]]:
    for name, number in _sets(variables, "els", "elem_els", "elementset"):
        rows = numbers(variables, f"elem_els{number}") - 1
        yield name, [np.flatnonzero(np.isin(run.rows + block.first, rows)) for block in found for run in block.runs]


def _fields_of_points(variables: Named, points: int) -> Iterator[tuple[str, NDArray[Any]]]:
    named = titles(variables, "name_nod_var")
    for at, name in enumerate(named):
        table = f"vals_nod_var{at + 1}"
        if table in variables:
            values = _last(variables, table)
        else:
            together = _last(variables, "vals_nod_var")
            values = together[at] if together.ndim == 2 and at < len(together) else together[:0]
        if values.shape == (points,):
            yield name, values


def _fields_of_cells(variables: Named, found: Sequence[Block]) -> Iterator[tuple[str, list[NDArray[Any]]]]:
    """Fields of elements; those of blocks that lack one are not numbers there."""
    for at, name in enumerate(titles(variables, "name_elem_var"), 1):
        runs: list[NDArray[Any]] = []
        some = False
        for block in found:
            values = _last(variables, f"vals_elem_var{at}eb{re.sub(r'[^0-9]', '', block.table)}")
            fits = values.shape == (block.size,)
            some |= fits
            runs += [values[run.rows] if fits else np.full(len(run.rows), np.nan) for run in block.runs]
        if some:
            yield name, runs


def _last(variables: Named, name: str) -> NDArray[Any]:
    """Return what a field is in the last time step; nothing where there is none."""
    found = variables.get(name)
    return found.last() if found is not None and found.shape[:1] > (0,) else np.empty(0)
