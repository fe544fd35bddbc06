"""The groups of a file, whatever it calls them: physical groups, families, sets, markers, parts.

Formats give them as the sets and groups of `source.Arrays`; what belongs to a name is found out here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.source import PHYSICAL, Cells, Source

Int64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Group:
    """All that a file calls by one name.

    Attributes
    ----------
    cells : sequence of (Cells, (k,) int64)
        Runs, and which of their cells belong to it.
    nodes : (k,) int64
        Rows of the points that belong to it by themselves.
    dimension : int or None
        Of its cells, where the file tells it though there are none.
    """

    cells: Sequence[tuple[Cells, Int64]]
    nodes: Int64
    dimension: int | None = None

    @property
    def counts(self) -> dict[int, int]:
        """How many cells there are by their dimension, highest first; points count with cells that are vertices."""
        counts = {} if self.dimension is None else {self.dimension: 0}
        alone = [self.nodes]
        for run, rows in self.cells:
            dimension = dimension_of(run.type)
            if dimension == 0:
                alone.append(_vertices(run, rows))
            else:
                counts[dimension] = counts.get(dimension, 0) + len(rows)
        if vertices := len(_distinct(alone)):
            counts[0] = vertices
        return dict(sorted(counts.items(), reverse=True))

    @property
    def points(self) -> Int64:
        """Rows (k,) of its points and of the vertices of its cells, ascending, as the file has them."""
        return _distinct([self.nodes, *(_vertices(run, rows) for run, rows in self.cells)])

    def rows(self, source: Source) -> list[Int64]:
        """Return the rows of its cells in each run of the source that it is of."""
        mine = {id(run): rows for run, rows in self.cells}
        return [mine.get(id(run), np.empty(0, dtype=np.int64)) for run in source.cells]


def groups_of(source: Source) -> dict[str, Group]:
    """Return the groups of a file by their names, in its order."""
    arrays = source.arrays
    numbered = {name: about for name, about in arrays.groups.items() if _is_numbered(about)}
    found: dict[str, dict[int, list[Int64]]] = {name: {} for name in (*numbered, *arrays.cell_sets, *arrays.point_sets)}
    for name, run, rows in (*_by_number(source, numbered), *_by_name(arrays.cell_sets)):
        found[name].setdefault(run, []).append(rows)
    return {
        name: Group(
            [(source.cells[run], _distinct(parts)) for run, parts in sorted(runs.items())],
            _distinct([np.asarray(arrays.point_sets.get(name, ()), dtype=np.int64)]),
            int(numbered[name][1]) if name in numbered else None,
        )
        for name, runs in found.items()
    }


def _is_numbered(about: Any) -> bool:
    """Whether this is a group's number and dimension, and no data of the whole mesh, which meshio has beside them."""
    values = np.asarray(about)
    return values.shape == (2,) and values.dtype.kind in "iu"


def _by_number(source: Source, numbered: Mapping[str, Any]) -> Iterator[tuple[str, int, Int64]]:
    """Give the names of groups that have a number, runs, and rows of their cells there."""
    names: dict[tuple[int, int], list[str]] = {}
    for name, (number, dimension) in numbered.items():
        names.setdefault((int(dimension), int(number)), []).append(name)
    arrays = source.arrays.cell
    numbering = next((name for name in (PHYSICAL, *source.regions) if name in arrays), None)
    for run, labels in enumerate(arrays[numbering] if numbering else ()):
        numbers = np.abs(labels)  # the sign is an orientation
        order = np.argsort(numbers, kind="stable")
        values, first = np.unique(numbers[order], return_index=True)
        for value, rows in zip(values.tolist(), np.split(order, first[1:]), strict=False):
            for name in names.get((dimension_of(source.cells[run].type), value), ()):
                yield name, run, rows


def _by_name(sets: Mapping[str, Sequence[Any]]) -> Iterator[tuple[str, int, Int64]]:
    for name, runs in sets.items():
        for run, rows in enumerate(runs):
            if len(rows):
                yield name, run, np.asarray(rows, dtype=np.int64)


def _vertices(run: Cells, rows: Int64) -> Int64:
    """Return the vertices of some cells of a run."""
    if isinstance(run.vertices, np.ndarray):
        return run.vertices[rows].ravel().astype(np.int64)
    return np.concatenate([np.empty(0, dtype=np.int64), *(np.asarray(run.vertices[row]) for row in rows.tolist())])


def _distinct(parts: Sequence[Int64]) -> Int64:
    rows = np.concatenate(parts) if len(parts) != 1 else parts[0]
    return rows if (rows[1:] > rows[:-1]).all() else np.unique(rows)  # most are in order
