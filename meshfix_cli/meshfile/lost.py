"""What a file that was made of another does not hold, found by reading it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.groups import Group, groups_of
from meshfix_cli.meshfile.numbering import numbers_of, numbers_of_nodes
from meshfix_cli.meshfile.source import NO_NUMBER, Cells, Source

Int64 = NDArray[np.int64]


def lost(source: Source, other: Source) -> tuple[str, ...]:
    """Name what another source does not hold that was written from one, and is in its order."""
    found = (*_cells(source, other), *_arrays(source, other), *_groups(source, other), *_numbers(source, other))
    return tuple(dict.fromkeys((*found, *source.arrays.unread, *source.untold)))


def _cells(source: Source, other: Source) -> Iterator[str]:
    mine, theirs = _counts(source.cells), _counts(other.cells)
    yield from (f"{key} cells" for key, count in mine.items() if theirs[key] < count)


def _counts(cells: Sequence[Cells]) -> Counter[str]:
    counts = Counter[str]()
    for run in cells:
        counts[run.type] += len(run.vertices)
    return counts


def _arrays(source: Source, other: Source) -> Iterator[str]:
    mine, theirs = source.arrays, other.arrays
    found = [np.asarray(values) for values in theirs.point.values()]
    yield from (f"point data {name}" for name, values in mine.point.items() if not _is_among(values, found))
    found = [np.concatenate(runs) for runs in theirs.cell.values()]
    for name, runs in mine.cell.items():
        values, others = np.concatenate(runs), found
        if name in source.regions and values.ndim == 1 and values.dtype.kind in "iuf":
            some = values != 0  # 0 is no region, and another format may number what is in none
            values, others = values[some], [one[some] for one in found if len(one) == len(some)]
        if not _is_among(values, others):
            yield f"cell data {name}"


def _is_among(values: Any, found: Sequence[NDArray[Any]]) -> bool:
    """Whether one of some arrays has the same values, but for what seven digits cannot hold."""
    mine = np.asarray(values).ravel()
    for other in found:
        theirs = other.ravel()
        if mine.size != theirs.size:
            continue
        if mine.dtype.kind in "fiu" and theirs.dtype.kind in "fiu":
            if np.allclose(mine, theirs, 1e-6, 0.0, equal_nan=True):
                return True
        elif np.array_equal(mine, theirs):
            return True
    return False


def _groups(source: Source, other: Source) -> Iterator[str]:
    """Name groups that are not there, or have other members: of those of two kinds a format may hold one."""
    mine, theirs = groups_of(source), groups_of(other)
    for name in (*source.arrays.groups, *mine):
        there = name in theirs if name in mine else name in other.arrays.groups
        if not there or (name in mine and not _are_same(mine[name], theirs[name])):
            yield f"group {name}"


def _are_same(one: Group, other: Group) -> bool:
    """Whether groups have the same members; nodes may stand for vertices, and sides of elements for facets."""
    counts = [Counter({run.type: 0 for run, _ in group.cells}) for group in (one, other)]
    for group, mine in zip((one, other), counts, strict=True):
        for run, rows in group.cells:
            mine[run.type] += len(rows)
    alike = +counts[0] == +counts[1] and np.array_equal(one.nodes, other.nodes)
    return alike or np.array_equal(one.points, other.points)


def _numbers(source: Source, other: Source) -> Iterator[str]:
    """Name numbers that are others; those that tell no more than the order does are not lost."""
    nodes = numbers_of_nodes(source)
    if nodes is not None and not _are_order([nodes]):
        there = (numbers_of_nodes(other), *other.arrays.point.values())  # VTK has them as data
        if not any(np.array_equal(nodes, values) for values in there if values is not None):
            yield "numbers of nodes"
    mine, theirs = _by_type(source.cells), _by_type(other.cells)
    pairs = [(numbers, theirs[key]) for key, numbers in mine.items() if key in theirs]
    if not (_are_order([numbers for numbers, _ in pairs]) or all(_has(found, numbers) for numbers, found in pairs)):
        yield "numbers of elements"


def _by_type(cells: Sequence[Cells]) -> dict[str, Int64]:
    """Return the numbers of the cells of each type."""
    found: dict[str, list[Int64]] = {}
    for run in cells:
        found.setdefault(run.type, []).append(numbers_of(run))
    return {key: np.concatenate(parts) for key, parts in found.items()}


def _has(there: Int64, numbers: Int64) -> bool:
    """Whether cells that are there have such numbers, where these are some."""
    some = numbers != NO_NUMBER
    return len(there) == len(numbers) and np.array_equal(there[some], numbers[some])


def _are_order(runs: Sequence[Int64]) -> bool:
    """Whether numbers only count, all of them or those of each run, from 0 or 1; from 0 they are places in a file."""
    given = [numbers[numbers != NO_NUMBER] for numbers in runs]
    whole = np.concatenate([np.empty(0, dtype=np.int64), *given])
    places = np.sort(whole) if len(whole) and not whole.min() else whole
    return _only_counts(places) or all(map(_only_counts, given))


def _only_counts(numbers: Int64) -> bool:
    return not len(numbers) or (numbers[0] in (0, 1) and np.array_equal(numbers, numbers[0] + np.arange(len(numbers))))
