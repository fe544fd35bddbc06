"""A mesh that lies in several files: its pieces are joined when they are read, and written back one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, naming
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.joining import Copies, Int64, by_numbers, by_place, joined
from meshfix_cli.meshfile.source import Arrays, Cells, Family, Source, ghost_vertices
from meshfix_cli.meshfile.splice import Points, Turned, differing


class _Origin(NamedTuple):
    """Where a run of the mesh comes from: piece, run, and the rows (m,) of its cells there."""

    piece: int
    run: int
    rows: Int64


@dataclass(frozen=True, eq=False)
class Joined:
    """The layout of a mesh that lies in several files; see `source.Pieces`.

    Attributes
    ----------
    family : Family
    sources : sequence of Source
        The pieces.
    rows : sequence of (k,) int64
        For the points of each piece, which points of the mesh they are.
    origins : sequence of _Origin
        For each run of cells.
    """

    family: Family
    sources: Sequence[Source]
    rows: Sequence[Int64]
    origins: Sequence[_Origin]

    @property
    def paths(self) -> Sequence[Path]:
        """Where the pieces are."""
        return self.family.paths

    def targets(self, target: str) -> list[str]:
        """Return where those of an output go; WriteError where that cannot be."""
        return self.family.targets(target)

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the pieces can hold them."""
        return _filled(self.sources)[0].rounded(points)

    def turned(self, original: Points, cells: Mapping[int, Turned], threads: int) -> Source:
        """Return the mesh with some cells turned."""
        return join(self.family, self.family.parse(list(self.rewritten(original, original, cells))), threads)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> Iterator[bytes]:
        """Give each piece with other points (n, d) of the mesh, and with some cells turned."""
        turned: list[dict[int, Turned]] = [{} for _ in self.sources]
        for run, cells in reversed_cells.items():
            origin = self.origins[run]
            turned[origin.piece][origin.run] = cells._replace(rows=origin.rows[cells.rows])
        if reversed_cells and any(run.ghosts is not None for source in self.sources for run in source.cells):
            raise ReadError("has ghost cells, of which the copies would keep their numbering")
        changed = differing(original, points)
        for source, rows, here in zip(self.sources, self.rows, turned, strict=True):
            own = np.where(changed[rows], points[rows], source.points)
            assert source.layout is not None  # families read only what can be written back
            yield source.layout.rewritten(source.points, own, here)

    def files(self, target: str, original: Points, points: Points) -> Iterator[tuple[str, bytes]]:
        """Give names and contents of all files of an output, what names the pieces last."""
        targets = self.targets(target)
        yield from zip(targets, self.rewritten(original, points, {}), strict=True)
        yield from self.family.beside(target, targets)


def join(family: Family, sources: Sequence[Source], threads: int = 1) -> Source:
    """Make one mesh of its pieces.

    Points are joined by their numbers, where the pieces have some, else where they are at one place on the pieces'
    boundaries; the joined points and cells are in the order of the pieces. Ghost cells that repeat others are left out.

    Raises
    ------
    ReadError
        The pieces do not fit together.
    """
    starts = np.cumsum([0, *(len(source.points) for source in sources)])
    points = np.concatenate([source.points for source in _alike(family, sources)])
    piece = np.repeat(np.arange(len(sources)), np.diff(starts))
    copies = Copies(family.names, points, piece, _all_cells(family, sources, starts))
    numbers = _numbers(family, sources)
    labels = by_place(copies, threads) if numbers is None else by_numbers(copies, numbers)
    rows, chosen = joined(labels, copies.of_cells(copies.cells))
    cells = [replace(run, vertices=rows[run.vertices]) for run in copies.cells]
    kept = _without_repetitions(cells, len(chosen))
    runs = [(i, number) for i, source in enumerate(sources) for number in range(len(source.cells))]
    origins = [_Origin(*run, here) for run, here in zip(runs, kept, strict=True)]
    cells = [_some(run, here) for run, here in zip(cells, kept, strict=True)]
    by_piece = np.split(rows, starts[1:-1])
    common = int((np.bincount(rows) > 1).sum())
    how = "equal coordinates" if numbers is None else family.numbers
    files, points_of_several = counted(len(sources), "file", "files"), counted(common, "common point", "common points")
    note = f"joined {files} at {points_of_several}, by {how}"
    return Source(
        points[chosen],
        cells,
        load=lambda: _arrays(sources, by_piece, chosen, origins),
        regions=_regions(family, sources),
        held=_held(sources, by_piece, cells, len(chosen)),
        untold=_distinct(source.untold for source in sources),
        notes=(note, *_distinct(source.notes for source in sources)),
        numbers=lambda: None if numbers is None else numbers[chosen],
        pieces=Joined(family, sources, by_piece, origins),
    )


def _held(sources: Sequence[Source], rows: Sequence[Int64], cells: Sequence[Cells], n: int) -> NDArray[np.bool_] | None:
    """Mark the points (n,) of ghost cells, and those that pieces hold for another reason; None: there are none."""
    ghosts, held = ghost_vertices(cells, n), np.zeros(n, dtype=bool)
    for source, mine in zip(sources, rows, strict=True):
        if source.held is not None:
            of_ghosts = ghost_vertices(source.cells, len(source.points))
            held[mine[source.held if of_ghosts is None else source.held & ~of_ghosts]] = True
    if ghosts is None:
        return held if held.any() else None
    return held | ghosts


def _filled(sources: Sequence[Source]) -> list[Source]:
    """Those that have points; the first where none has."""
    return [source for source in sources if len(source.points)] or list(sources[:1])


def _alike(family: Family, sources: Sequence[Source]) -> list[Source]:
    """Those that have points, of one type."""
    filled = _filled(sources)
    for source in filled:
        if source.points.dtype != filled[0].points.dtype:
            one, other = (
                f"{one.points.dtype.name} in {family.names[sources.index(one)]}" for one in (filled[0], source)
            )
            raise ReadError(f"the pieces have coordinates of several types: {one}, {other}")
    return filled


def _all_cells(family: Family, sources: Sequence[Source], starts: Int64) -> list[Cells]:
    """The cells of all pieces with vertices and, by position, numbers that go on from piece to piece."""
    cells = []
    before = 0
    for name, source, start in zip(family.names, sources, starts.tolist(), strict=False):
        for run in source.cells:
            vertices = run.vertices.astype(np.int64)
            outside = (vertices < 0) | (vertices >= len(source.points))
            ids = np.arange(len(vertices)) if run.ids is None else run.ids
            if outside.any():
                raise ReadError(f"{name}: its cell {ids[outside.any(axis=1)][0]} has a vertex that is not in it")
            cells.append(replace(run, vertices=vertices + start, ids=ids + before if family.by_position else ids))
        before += sum(len(run.vertices) for run in source.cells)
    return cells


def _numbers(family: Family, sources: Sequence[Source]) -> Int64 | None:
    """The numbers of the points of all pieces, if they have some."""
    filled, found = _filled(sources), []
    for source in filled:
        with naming(family.names[sources.index(source)]):
            found.append(source.numbers())
    present = [numbers for numbers in found if numbers is not None]
    if not present:
        return None
    if len(present) < len(found):
        lacking = next(source for source, numbers in zip(filled, found, strict=True) if numbers is None)
        raise ReadError(f"{family.names[sources.index(lacking)]}: has no {family.numbers}, and other pieces have")
    return np.concatenate(present)


def _without_repetitions(cells: Sequence[Cells], n: int) -> list[Int64]:
    """Return for each run the rows of its cells, but for ghosts that are other cells as well."""
    near = ghost_vertices(cells, n)
    if near is None:
        return [np.arange(len(run.vertices)) for run in cells]
    kept = [np.ones(len(run.vertices), dtype=bool) for run in cells]
    kinds = {(run.type, run.vertices.shape[1]) for run in cells if run.ghosts is not None and run.ghosts.any()}
    for kind in kinds:
        runs = [i for i, run in enumerate(cells) if (run.type, run.vertices.shape[1]) == kind]
        vertices = np.sort(np.concatenate([cells[i].vertices for i in runs]), axis=1)
        ghosts = np.concatenate([_ghosts(cells[i]) for i in runs])
        at = np.flatnonzero(near[vertices].all(axis=1))
        group = np.unique(vertices[at], axis=0, return_inverse=True)[1].reshape(-1)
        owned = np.bincount(group, ~ghosts[at]) > 0
        repeated = np.zeros_like(ghosts)
        repeated[at] = ghosts[at] & owned[group]
        for i, mask in zip(runs, np.split(repeated, np.cumsum([len(kept[i]) for i in runs])[:-1]), strict=True):
            kept[i] = ~mask
    return [np.flatnonzero(mask) for mask in kept]


def _ghosts(run: Cells) -> NDArray[np.bool_]:
    return np.zeros(len(run.vertices), dtype=bool) if run.ghosts is None else run.ghosts


def _some(run: Cells, rows: Int64) -> Cells:
    """Return some cells of a run."""
    return replace(
        run,
        vertices=run.vertices[rows],
        ids=None if run.ids is None else run.ids[rows],
        ghosts=None if run.ghosts is None else run.ghosts[rows],
    )


def _regions(family: Family, sources: Sequence[Source]) -> tuple[str, ...]:
    """The arrays that tell regions apart, which all pieces with cells must have: else an interface would move."""
    regions = _distinct(source.regions for source in sources)
    for i, source in enumerate(sources):
        for name in regions if source.cells else ():
            if name not in source.regions and name not in source.arrays.cell:
                raise ReadError(f"{family.names[i]}: has no cell data {name!r}, and other pieces have")
    return regions


def _arrays(sources: Sequence[Source], rows: Sequence[Int64], chosen: Int64, origins: Sequence[_Origin]) -> Arrays:
    """The arrays that all pieces have, and the sets that any has, of the points and cells of the mesh."""
    filled = _filled(sources)
    point, lost = _common([source.arrays.point for source in filled])
    full = [i for i, source in enumerate(sources) if source.cells]
    by_piece = [{name: runs[0][:1] for name, runs in sources[i].arrays.cell.items()} for i in full]
    cell, lost_of_cells = _common(by_piece)
    groups: dict[str, Any] = {}
    for source in sources:
        groups |= source.arrays.groups
    unread = [f"point data {name}" for name in lost] + [f"cell data {name}" for name in lost_of_cells]
    return Arrays(
        {name: np.concatenate([source.arrays.point[name] for source in filled])[chosen] for name in point},
        {name: [sources[one.piece].arrays.cell[name][one.run][one.rows] for one in origins] for name in cell},
        groups,
        _point_sets(sources, rows),
        _cell_sets(sources, origins),
        unread=_distinct([*(source.arrays.unread for source in sources), unread]),
    )


def _point_sets(sources: Sequence[Source], rows: Sequence[Int64]) -> dict[str, Int64]:
    sets: dict[str, list[Int64]] = {}
    for source, here in zip(sources, rows, strict=True):
        for name, points in source.arrays.point_sets.items():
            sets.setdefault(name, []).append(here[points])
    return {name: np.unique(np.concatenate(parts)) for name, parts in sets.items()}


def _cell_sets(sources: Sequence[Source], origins: Sequence[_Origin]) -> dict[str, list[Int64]]:
    sets: dict[str, list[Int64]] = {}
    for i, one in enumerate(origins):
        for name, runs in sources[one.piece].arrays.cell_sets.items():
            mine = sets.setdefault(name, [np.empty(0, dtype=np.int64)] * len(origins))
            mine[i] = np.flatnonzero(np.isin(one.rows, runs[one.run]))
    return sets


def _common(tables: Sequence[Mapping[str, NDArray[Any]]]) -> tuple[list[str], list[str]]:
    """Names of the arrays that all tables have, with as many components, and of the others."""
    names = list(dict.fromkeys(name for table in tables for name in table))
    shapes = {name: {table[name].shape[1:] if name in table else None for table in tables} for name in names}
    common = [name for name in names if len(shapes[name]) == 1]
    return common, [name for name in names if name not in common]


def _distinct(parts: Any) -> tuple[str, ...]:
    return tuple(dict.fromkeys(text for part in parts for text in part))
