"""The numbers that files give to nodes and elements: those that another format has as well, and new ones."""

from __future__ import annotations

from collections.abc import Sequence
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
