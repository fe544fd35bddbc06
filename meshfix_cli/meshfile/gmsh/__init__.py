"""Files of gmsh, .msh: versions 1, 2.0 to 2.2 and 4.1, in text and, but for the first, binary.

Source: "Gmsh Reference Manual", chapter "Gmsh file formats", and there "Legacy formats".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, naming
from meshfix_cli.mesh.elements import counted, dimension_of
from meshfix_cli.meshfile.gmsh.cells import TYPES, order_of
from meshfix_cli.meshfile.gmsh.numbers import Int64
from meshfix_cli.meshfile.gmsh.sections import Block, File, Numbers, UnknownError, read
from meshfix_cli.meshfile.solved import solved_runs
from meshfix_cli.meshfile.source import PHYSICAL, Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Numbering

SETS, ENTITY = "gmsh:physical_set", "gmsh:geometrical"


def parse(data: bytes) -> Source | None:
    """Read nodes and elements; None: numbers of another size."""
    try:
        file = read(data)
    except UnknownError:
        return None
    if not file.blocks:
        raise ReadError("is not a readable gmsh file: there are no $Elements in it")
    return _source(data, file, _labels([file])[0])


def parse_parts(parts: Sequence[tuple[str, bytes]]) -> list[Source]:
    """Read files that are the parts of one mesh: names and contents.

    gmsh leaves elements out that are in no group, where others are; so a part may have none.
    """
    files = []
    for name, data in parts:
        with naming(name):
            try:
                files.append(read(data))
            except UnknownError as error:
                raise ReadError("is of a kind that is not read: save it as 2.2 or 4.1") from error
    sources = []
    for (name, data), file, labels in zip(parts, files, _labels(files), strict=True):
        with naming(name):
            source = _source(data, file, labels)
        lacking = () if source.cells else (f"there are no elements in {name}",)
        sources.append(replace(source, notes=(*source.notes, *lacking)))
    partitions = max(file.partitions for file in files)
    if partitions > len(files):
        there = f"there {'is' if len(files) == 1 else 'are'} {counted(len(files), 'file', 'files')}"
        note = f"{there}, and {partitions} partitions of the mesh"
        sources[0] = replace(sources[0], notes=(*sources[0].notes, note))
    return sources


def _source(data: bytes, file: File, labels: dict[str, list[Int64]]) -> Source:
    if not file.tags:
        raise ReadError("is not a readable gmsh file: there are no $Nodes in it")
    tags, coordinates = np.concatenate(file.tags), _joined(file.coordinates)
    find = _finder(tags)
    cells = [
        Cells(TYPES[block.kind][0], _vertices(block, find), block.ids, file.ghosts(block)) for block in file.blocks
    ]
    by_corner = "section $ElementNodeData" in file.untold
    layout = InPlace(data, coordinates, [_refuse if by_corner else partial(_corners, block) for block in file.blocks])
    load, regions = partial(_load, file, tags, cells, labels), _regions(file, cells, labels)
    notes = ("the parameters (u, v) of nodes on curves and faces stay as they are",) * file.parametric
    points = coordinates.read(data)
    held = _paired(file, find, len(tags))
    return Source(points, cells, layout, load, regions, held, tuple(file.untold), notes, numbers=lambda: tags)


def _paired(file: File, find: Callable[[Int64], Int64], n: int) -> NDArray[np.bool_] | None:
    """Mark the nodes (n,) that have a copy or are one: moved alone, they would not lie as the file tells."""
    if not file.periodic:
        return None
    rows = find(np.concatenate(file.periodic))
    paired = np.zeros(n, dtype=bool)
    paired[rows[rows >= 0]] = True
    return paired


def _refuse() -> Places:
    raise ReadError("has data for the corners of elements, which would be those of others if elements were renumbered")


def _finder(tags: Int64) -> Callable[[Int64], Int64]:
    """Return what finds the rows of nodes by their tags, which may be any numbers; -1: there is no such node."""
    numbering = Numbering(tags)
    if (tag := numbering.twice()) is not None:
        raise ReadError(f"is not a readable gmsh file: the node {tag} stands twice in it")
    return numbering.rows_of


def _vertices(block: Block, find: Callable[[Int64], Int64]) -> Int64:
    rows = find(block.nodes)
    missing = rows < 0
    if missing.any():
        element = block.ids[missing.any(axis=1)][0]
        raise ReadError(f"the element {element} has the node {block.nodes[missing][0]}, which is not in $Nodes")
    order = order_of(TYPES[block.kind][0])
    return rows if order is None else rows[:, order]


def _corners(block: Block) -> Places:
    order = order_of(TYPES[block.kind][0])
    return block.corners() if order is None else block.corners().at((slice(None), order))


def _joined(places: Sequence[Places]) -> Places:
    ends = [one.end for one in places if one.end is not None]
    begin = np.concatenate([one.begin for one in places])
    return Places(begin, np.concatenate(ends) if ends else None, places[0].dtype)


def _labels(files: Sequence[File]) -> list[dict[str, list[Int64]]]:
    """Entities and physical groups of the elements; where an entity is in several, also a number for each set.

    What one file has, the others of a mesh have as well, with the same numbers.
    """
    blocks = [block for file in files for block in file.blocks]
    sets = [file.groups.get(block.entity, ()) for file in files for block in file.blocks]
    physical = [
        np.full(len(block.ids), (*groups, 0)[0]) if block.physical is None else block.physical
        for block, groups in zip(blocks, sets, strict=True)
    ]
    labels = {ENTITY: [block.entities for block in blocks]}
    if any(values.any() for values in physical):
        labels[PHYSICAL] = physical
    if any(len(groups) > 1 for groups in sets):
        known: dict[frozenset[int], int] = {frozenset(): 0}
        codes = [known.setdefault(frozenset(groups), len(known)) for groups in sets]
        labels[SETS] = [np.full(len(block.ids), code) for block, code in zip(blocks, codes, strict=True)]
    ends = np.cumsum([len(file.blocks) for file in files]).tolist()
    return [
        {name: values[end - len(file.blocks) : end] for name, values in labels.items()}
        for file, end in zip(files, ends, strict=True)
    ]


def _ids(cells: Sequence[Cells]) -> Int64:
    return np.concatenate([np.empty(0, dtype=np.int64), *(run.ids for run in cells if run.ids is not None)])


def _regions(file: File, cells: Sequence[Cells], labels: Mapping[str, Sequence[Int64]]) -> tuple[str, ...]:
    """The array of groups, if an element that is solved for is in one; in version 1 entities are as good as groups."""
    names = (SETS if SETS in labels else PHYSICAL, *((ENTITY,) if file.first else ()))
    return tuple(name for name in names if name in labels and any(labels[name][i].any() for i in solved_runs(cells)))


def _load(file: File, tags: Int64, cells: Sequence[Cells], labels: Mapping[str, list[Int64]]) -> Arrays:
    """Labels and views."""
    unread = []
    point: dict[str, Any] = {}
    cell: dict[str, Any] = dict(labels)
    ends = np.cumsum([len(run.vertices) for run in cells])
    ids = _ids(cells)
    for section, numbers in file.views:
        arrays, wanted = (point, tags) if section == "NodeData" else (cell, ids)
        try:
            name, step, values = _view(numbers, wanted)
        except ReadError:
            unread.append(f"a section ${section} that cannot be read")
            continue
        name = f"{name} step {step}" if name in arrays else name
        arrays[name] = values if section == "NodeData" else np.split(values, ends[:-1])
    groups = {title: np.array([number, dimension]) for dimension, number, title in file.titles}
    told = PHYSICAL not in labels or (SETS not in labels and len(groups) == len(file.titles))
    sets = {} if told else _sets(file, cells, labels)
    return Arrays(point, cell, groups, cell_sets=sets, unread=tuple(unread))


def _sets(file: File, cells: Sequence[Cells], labels: Mapping[str, list[Int64]]) -> dict[str, list[Int64]]:
    """The rows of the cells of each group that has a name: an entity may be in several, and several may have one."""
    titles: dict[tuple[int, int], list[str]] = {}
    for dimension, number, title in file.titles:
        titles.setdefault((dimension, number), []).append(title)
    sets: dict[str, list[Int64]] = {}
    for i, (block, run, physical) in enumerate(zip(file.blocks, cells, labels[PHYSICAL], strict=True)):
        of_entity = file.groups.get(block.entity, ())  # of version 4.1
        for number in of_entity or np.unique(physical).tolist():
            rows = np.arange(len(physical)) if of_entity else np.flatnonzero(physical == number)
            for title in titles.get((dimension_of(run.type), abs(number)), ()):
                mine = sets.setdefault(title, [np.empty(0, dtype=np.int64)] * len(cells))
                mine[i] = np.union1d(mine[i], rows)
    return sets


def _view(numbers: Numbers, wanted: Int64) -> tuple[str, int, NDArray[np.float64]]:
    """Read the name of some data, their step in time, and the values of nodes or elements; nan: there are none."""
    here = replace(numbers)
    titles = [here.line() for _ in range(here.count())]
    for _ in range(here.count()):
        here.line()
    about = [here.count() for _ in range(here.count())]
    if not titles or len(about) < 3 or about[1] < 1:
        raise ReadError("is not a readable gmsh file: data have no name or no size")
    tags, places = here.tagged(about[2], about[1])
    rows = Numbering(tags).rows_of(wanted)
    values = np.full((len(wanted), about[1]), np.nan)
    values[rows >= 0] = places.read(here.data)[rows[rows >= 0]]
    name = titles[0].decode("utf-8", "replace").strip().strip('"')
    return name, about[0], values[:, 0] if about[1] == 1 else values
