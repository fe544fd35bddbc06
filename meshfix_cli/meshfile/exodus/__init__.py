"""Exodus II files: variables of netCDF, one for each coordinate or one for all of them, and one for each block.

The numbers of the classic forms of netCDF stand in the bytes as they are; the fourth is a file of HDF5.

Source: L. A. Schoof, V. R. Yarberry, "EXODUS II: a finite element data model", SAND92-2137, and the documentation of
SEACAS, which goes on with it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from functools import partial

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.exodus.blocks import Block, Named, Run, blocks, numbers, titles
from meshfix_cli.meshfile.exodus.sets import arrays, regions_of
from meshfix_cli.meshfile.exodus.variables import Variables, opened
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Arrays, Cells, Source

_COORDINATES = ("coordx", "coordy", "coordz")
# Variables that are read, or say nothing of their own; those of a file of HDF5 have one for each dimension, too.
_TOLD = re.compile(
    r"coord[xyz]?|coor_names|(connect|facconn|fbconn|ebepecnt|fbepecnt|node_ns|elem_ss|side_ss|elem_els)\d+"
    r"|(eb|ns|ss|els)_(names|status|prop1)|(elem|node)_num_map|name_(nod|elem)_var|vals_nod_var\d*|vals_elem_var\d+eb\d+"
    r"|elem_var_tab|time_whole|(num|len)_.*|time_step|four"
)


def parse(data: bytes) -> Source:
    """Read nodes, blocks, sets and fields."""
    with opened(data) as variables:
        return source_of(variables, partial(opened, data))


def source_of(variables: Variables, again: Callable[[], AbstractContextManager[Variables]]) -> Source:
    """Return what variables hold, which are opened again where sets and fields are asked for."""
    named = variables.named
    table = _coordinates(named)
    n, dimension = table.at.shape
    found = blocks(named, dimension)
    runs = [(block, run) for block in found for run in block.runs]
    layout = variables.layout(table, [partial(_corners, block.table, run) for block, run in runs])
    flat = np.concatenate([named[name].values().ravel() for name in table.sets])
    ids, nodes = numbers(named, "elem_num_map"), numbers(named, "node_num_map")
    untold = tuple(_untold(named))
    if len(ids) != sum(block.size for block in found):
        ids = np.arange(1, sum(block.size for block in found) + 1)
    cells = [Cells(run.type, run.vertices, ids[run.rows + block.first]) for block, run in runs]
    load = partial(_arrays, again, found, n, dimension)
    regions = regions_of(titles(named, "name_elem_var"))
    return Source(
        np.ascontiguousarray(flat[table.at]),
        cells,
        layout,
        load,
        regions,
        untold=untold,
        numbers=lambda: nodes if len(nodes) == n else None,
    )


def _coordinates(named: Named) -> Table:
    """Return where the coordinates stand: in a variable for each, or one behind the other in one."""
    sets = [name for name in _COORDINATES if name in named]
    shapes = {named[name].shape for name in sets or ["coord"] if name in named}
    if not shapes:
        raise ReadError("is a file of netCDF, and no mesh of Exodus: it has no coordinates")
    shape = shapes.pop()
    if shapes or len(shape) != (1 if sets else 2):
        raise ReadError("is not a readable exodus file: its coordinates are not as many as its nodes")
    return Table.by_column(sets or ["coord"], shape[-1], len(sets) or shape[0])


def _corners(table: str, run: Run) -> Table:
    return Table([table], run.at())


def _arrays(
    again: Callable[[], AbstractContextManager[Variables]], found: Sequence[Block], points: int, dimension: int
) -> Arrays:
    with again() as variables:
        return arrays(variables.named, found, points, dimension)


def _untold(named: Named) -> Iterator[str]:
    """What the file holds that no other would."""
    if named["time_whole"].shape[:1] > (1,) if "time_whole" in named else False:
        yield "time steps before the last"
    others = dict.fromkeys(re.sub(r"\d.*", "", name) for name in named if not _TOLD.fullmatch(name))
    if others:
        yield f"variables {', '.join(others)}"
