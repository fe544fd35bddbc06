"""The numbers that files give to nodes and elements: which of them another format has as well, and which are lost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import NO_NUMBER, Cells, Source

Int64 = NDArray[np.int64]


def numbers_of_nodes(source: Source) -> Int64 | None:
    """Return the numbers (n,) of the nodes; None: there are none, or they cannot be read."""
    with suppress(ReadError):
        return source.numbers()
    return None


def numbers_of(run: Cells) -> Int64:
    """Return the numbers (m,) of cells."""
    return np.full(len(run.vertices), NO_NUMBER) if run.ids is None else run.ids


def numbered(source: Source, held: Sequence[str], most: int) -> Source:
    """Return a source whose nodes and elements have the numbers of a file of another format.

    They keep those that they have, where these are positive, different, and not too large; else all have new ones.

    Parameters
    ----------
    held : sequence of str
        The types of cells that the file will have; others get no numbers.
    most : int
        The largest number that it can have.
    """
    nodes = _unique(numbers_of_nodes(source), len(source.points), most)
    kept = [i for i, run in enumerate(source.cells) if run.type in held and isinstance(run.vertices, np.ndarray)]
    sizes = [len(source.cells[i].vertices) for i in kept]
    given = [numbers_of(source.cells[i]) for i in kept]
    numbers = _unique(np.concatenate(given) if given else None, sum(sizes), most)
    ids = dict(zip(kept, np.split(numbers, np.cumsum(sizes)[:-1]), strict=False))
    cells = [replace(run, ids=ids.get(i)) for i, run in enumerate(source.cells)]
    return replace(source, cells=cells, numbers=lambda: nodes)


def lost(source: Source, other: Source) -> Iterator[str]:
    """Say which numbers another source, written from one of the same order, does not have.

    Those that tell no more than the order does are not lost.
    """
    nodes = numbers_of_nodes(source)
    if nodes is not None and not _are_order([nodes]):
        theirs = numbers_of_nodes(other)
        also = other.arrays.point.values()  # as VTK has them
        if not any(np.array_equal(nodes, values) for values in (theirs, *also) if values is not None):
            yield "numbers of nodes"
    runs = {run.type: run for run in other.cells}
    pairs = [(numbers_of(run), runs[run.type]) for run in source.cells if run.type in runs and run.ids is not None]
    if not _are_order([mine for mine, _ in pairs]) and not all(_has(run, mine) for mine, run in pairs):
        yield "numbers of elements"


def _has(run: Cells, numbers: Int64) -> bool:
    """Whether cells have such numbers, one for each."""
    some = numbers != NO_NUMBER
    if run.ids is None or len(run.ids) != len(numbers):
        return not some.any()
    return np.array_equal(run.ids[some], numbers[some])


def _unique(numbers: Int64 | None, count: int, most: int) -> Int64:
    """Return numbers (count,), with others behind them for what has none; from 1 where they cannot be had."""
    if numbers is not None:
        lacking = numbers == NO_NUMBER
        given = numbers[~lacking] if lacking.any() else numbers
        if len(given) and given.min() > 0 and given.max() <= most - lacking.sum() and _are_different(given):
            if len(given) == count:
                return numbers
            whole = numbers.copy()
            whole[lacking] = given.max() + 1 + np.arange(lacking.sum())
            return whole
    return np.arange(1, count + 1)


def _are_different(numbers: Int64) -> bool:
    return bool((numbers[1:] > numbers[:-1]).all() or (np.diff(np.sort(numbers)) > 0).all())


def _are_order(runs: Sequence[Int64]) -> bool:
    """Whether numbers only count, all of them or those of each run, from 0 or 1; from 0 they are places in a file."""
    given = [numbers[numbers != NO_NUMBER] for numbers in runs]
    whole = np.concatenate([np.empty(0, dtype=np.int64), *given])
    places = np.sort(whole) if len(whole) and not whole.min() else whole
    return _counts(places) or all(map(_counts, given))


def _counts(numbers: Int64) -> bool:
    return not len(numbers) or (numbers[0] in (0, 1) and np.array_equal(numbers, numbers[0] + np.arange(len(numbers))))
