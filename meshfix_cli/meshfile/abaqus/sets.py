"""The numbers that Abaqus .inp files give to nodes and elements, and the sets and sections that name these."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.abaqus.keywords import Block, Deck
from meshfix_cli.meshfile.source import Arrays
from meshfix_cli.meshfile.tables import Numbering
from meshfix_cli.meshfile.text import integers_at

SECTION = "abaqus:section"

_NO_NUMBER = re.compile(rb"[^\s\d,]")
_NUMBER = re.compile(rb"[0-9]{1,18}")  # of 64 bits
_EMPTY = np.empty(0, dtype=np.int64)
_NOTHING = Numbering(_EMPTY), _EMPTY

Sets = dict[tuple[str, str], NDArray[np.int64]]  # rows of points or cells for each scope and name in capitals


class Labels:
    """What a file defines with one keyword, *NODE or *ELEMENT.

    Attributes
    ----------
    rows : dict
        For each block the rows of what it defines.
    """

    def __init__(self, numbers: Mapping[Block, NDArray[np.int64]]) -> None:
        counts = [len(ids) for ids in numbers.values()]
        starts = np.cumsum([0, *counts])
        self.rows = {block: np.arange(*starts[i : i + 2]) for i, block in enumerate(numbers)}
        scopes: dict[str, list[Block]] = {}
        for block in numbers:
            scopes.setdefault(block.scope, []).append(block)
        self._scopes = {}
        for scope, blocks in scopes.items():
            numbering = Numbering(np.concatenate([numbers[block] for block in blocks]))
            self._scopes[scope] = numbering, np.concatenate([self.rows[block] for block in blocks])

    def rows_of(self, scope: str, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the rows (...) of numbers (...) of a scope; -1: there is none."""
        numbering, rows = self._scopes.get(scope, _NOTHING)
        at = numbering.rows_of(numbers)
        return np.where(at >= 0, rows[at], -1) if len(rows) else at

    def generated(self, scope: str, first: int, last: int, step: int = 1) -> NDArray[np.int64]:
        """Return the rows of the numbers from the first to the last, in steps."""
        numbering, rows = self._scopes.get(scope, _NOTHING)
        here = numbering.between(first, last)
        return rows[here][(numbering.numbers[here] - first) % max(step, 1) == 0]

    def twice(self) -> int | None:
        """Return a number that is given twice in one scope."""
        found = (numbering.twice() for numbering, _ in self._scopes.values())
        return next((number for number in found if number is not None), None)


def arrays(deck: Deck, nodes: Labels, elements: Labels, counts: Sequence[int], sections: Sequence[Block]) -> Arrays:
    """Read the sets, and number the elements by the section that names their set: from 1, 0 for those of none.

    Parameters
    ----------
    counts : sequence of int
        How many cells each run has.
    """
    point_sets, point_names = _sets(deck, "NODE", "NSET", nodes)
    cell_sets, cell_names = _sets(deck, "ELEMENT", "ELSET", elements)
    starts = np.cumsum([0, *counts])
    numbers = np.zeros(starts[-1], dtype=np.int64)
    for number, block in enumerate(sections, start=1):
        name = block.parameters["ELSET"]
        if (block.scope, name.upper()) not in cell_sets:
            raise ReadError(f"*{block.keyword} names the element set {name}, and there is none")
        numbers[cell_sets[block.scope, name.upper()]] = number
    if sections and sections[0].keyword == "ELSET":  # any sets may be materials, if each element is in one of them
        keys = {(block.scope, block.parameters["ELSET"].upper()) for block in sections}
        if sum(len(cell_sets[key]) for key in keys) != len(numbers) or not numbers.all():
            numbers[:] = 0
    return Arrays(
        cell={SECTION: np.split(numbers, starts[1:])[:-1]} if sections else {},
        point_sets={point_names[key]: rows for key, rows in point_sets.items()},
        cell_sets={cell_names[key]: _by_run(rows, starts) for key, rows in cell_sets.items()},
    )


def _by_run(rows: NDArray[np.int64], starts: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Divide sorted rows of all cells into rows of each run."""
    cuts = np.searchsorted(rows, starts)
    runs = [_EMPTY] * (len(starts) - 1)
    for i in np.flatnonzero(np.diff(cuts)).tolist():
        runs[i] = rows[cuts[i] : cuts[i + 1]] - starts[i]
    return runs


def _sets(deck: Deck, owner: str, keyword: str, labels: Labels) -> tuple[Sets, dict[tuple[str, str], str]]:
    """Read the sets of one kind; return sorted rows, and a name for each that no other has."""
    found: dict[tuple[str, str], list[NDArray[np.int64]]] = {}
    names: dict[tuple[str, str], str] = {}
    taken: set[str] = set()
    for block in deck.of(owner, keyword):
        if name := block.parameters.get(keyword):
            key = block.scope, name.upper()
            rows = [labels.rows[block]] if block.keyword == owner else _members(deck, block, labels, found)
            found.setdefault(key, []).extend(rows)
            if key not in names:
                names[key] = f"{block.scope or 'ASSEMBLY'} {name}" if name in taken else name
                taken.add(names[key])
    return {key: _rows(parts) for key, parts in found.items()}, names


def _rows(parts: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    rows = np.unique(np.concatenate([_EMPTY, *parts]))
    return rows[rows >= 0]


def _members(
    deck: Deck, block: Block, labels: Labels, found: Mapping[tuple[str, str], list[NDArray[np.int64]]]
) -> list[NDArray[np.int64]]:
    """Read the data lines of a set: numbers, ranges of numbers, or names of other sets."""
    instance = block.parameters.get("INSTANCE")
    scope = block.scope if instance is None else deck.instances.get(instance.upper(), instance)
    text = deck.text[block.begin : block.end]
    if "GENERATE" in block.parameters:
        ranges = (_NUMBER.findall(line)[:3] for line in text.splitlines())
        return [labels.generated(scope, *map(int, numbers)) for numbers in ranges if len(numbers) > 1]
    if not _NO_NUMBER.search(text):
        return [labels.rows_of(scope, integers_at(deck.text, deck.words(block)))]
    members = []
    for word in dict.fromkeys(re.split(r"[,\n]", text.decode("latin-1").upper())):
        whole = word.strip().strip("\"'")
        instance, _, name = whole.rpartition(".")
        there = deck.instances.get(instance, instance) if instance else scope
        if _NUMBER.fullmatch(name.encode()) and (scope, whole) not in found:
            members.append(labels.rows_of(there, np.array([int(name)])))
        else:  # a name may have a dot in it
            parts = found.get((scope, whole), found.get((there, name)))
            if parts is None and block.keyword == "ELSET" and whole not in ("", block.parameters["ELSET"].upper()):
                raise ReadError(f"*ELSET names the element set {whole}, and there is none")  # it may hide a material
            members.append(_rows(parts or []))
    return members
