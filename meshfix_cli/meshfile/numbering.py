"""The numbers that files give to nodes and elements: those that another format has as well, and new ones."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import dimension_of
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

    They keep those that they have, where these are positive and not too large; of a number that stands there twice the
    first has it, among elements of the highest dimension that have it. All others have new ones behind these.

    Parameters
    ----------
    held : sequence of str
        The types of cells that the file will have; others get no numbers.
    most : int
        The largest number that it can have.
    """
    given = numbers_of_nodes(source)
    (of_points,) = _without_places([np.full(len(source.points), NO_NUMBER) if given is None else given])
    nodes = _different(of_points, most)
    kept = [i for i, run in enumerate(source.cells) if run.type in held and isinstance(run.vertices, np.ndarray)]
    there = _without_places([numbers_of(run) for run in source.cells])
    if any((mine != NO_NUMBER).any() for mine in there):
        kept.sort(key=lambda i: -dimension_of(source.cells[i].type))
    ends = np.cumsum([0, *(len(there[i]) for i in kept)])
    numbers = _different(np.concatenate([np.empty(0, dtype=np.int64), *(there[i] for i in kept)]), most)
    ids = {i: numbers[begin:end] for i, (begin, end) in zip(kept, pairwise(ends.tolist()), strict=True)}
    cells = [replace(run, ids=ids.get(i)) for i, run in enumerate(source.cells)]
    return replace(source, cells=cells, numbers=lambda: nodes)


def _without_places(numbers: Sequence[Int64]) -> list[Int64]:
    """Return numbers as they are, or none where 0 is among them: these are places in the file."""
    places = any((mine == 0).any() for mine in numbers)
    return [np.full(len(mine), NO_NUMBER) if places else mine for mine in numbers]


def _different(numbers: Int64, most: int) -> Int64:
    """Return numbers (n,) as they are where they are different and from 1 to another, with new ones for the rest."""
    if not len(numbers) or (numbers[0] > 0 and numbers[-1] <= most and (numbers[1:] > numbers[:-1]).all()):
        return numbers
    fit = np.flatnonzero((numbers > 0) & (numbers <= most))
    kept, first = np.unique(numbers[fit], return_index=True)
    lacking = np.ones(len(numbers), dtype=bool)
    lacking[fit[first]] = False
    new = np.arange(1, lacking.sum() + 1) + (kept[-1] if len(kept) else 0)
    if len(new) and new[-1] > most:  # there are gaps
        new = np.setdiff1d(np.arange(1, len(numbers) + 1), kept)[: len(new)]
    whole = numbers.copy()
    whole[lacking] = new
    return whole
