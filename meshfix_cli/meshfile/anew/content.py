"""What is written of a mesh in another format: its elements, what tells materials apart, and sets by their names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import dimension_of, words
from meshfix_cli.meshfile.groups import Group, groups_of
from meshfix_cli.meshfile.numbering import numbers_of, numbers_of_nodes
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import PHYSICAL, Arrays, Cells, Source
from meshfix_cli.meshfile.splice import Points

Int64 = NDArray[np.int64]

IN_XML = " -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff"  # the characters of names there, see `words_of`


@dataclass(frozen=True, eq=False)
class Content:
    """A mesh as any format may hold it.

    Attributes
    ----------
    points : (n, d) float64
    cells : sequence of Cells
        One run for each type.
    nodes : (n,) int64
        The numbers of the points in formats that have such.
    elements : sequence of (m,) int64
        Those of the cells of each run.
    regions : sequence of (m,) int64, or None
        A number for each cell of each run, that of its material; None: nothing tells materials apart.
    titles : dict
        Names of materials by the dimension of their cells and by number, where they have any.
    sets : dict
        For each other group of cells its rows in each run.
    point_sets : dict
        Rows of points by name.
    arrays : Arrays
        All data as they are, those of materials among them.
    region : str or None
        The name of the array that `regions` are made of.
    """

    points: Points
    cells: Sequence[Cells]
    nodes: Int64
    elements: Sequence[Int64]
    regions: Sequence[Int64] | None
    titles: Mapping[tuple[int, int], str]
    sets: Mapping[str, Sequence[Int64]]
    point_sets: Mapping[str, Int64]
    arrays: Arrays
    region: str | None

    @classmethod
    def of(cls, source: Source, points: Points) -> Content:
        """Find what belongs to a name, in a source that has one run for each type."""
        arrays = source.arrays
        region = next((name for name in (PHYSICAL, *source.regions) if name in arrays.cell), None)
        labels = None if region is None else _whole([np.asarray(values) for values in arrays.cell[region]])
        if labels is not None and region == PHYSICAL:
            labels = [np.abs(values) for values in labels]  # the sign is an orientation
        named = {
            name: (int(about[1]), int(about[0]))
            for name, about in arrays.groups.items()
            if np.shape(about) == (2,) and np.asarray(about).dtype.kind in "iu"
        }
        titles = {key: name for name, key in named.items()} if labels is not None else {}
        sets: dict[str, list[Int64]] = {}
        point_sets: dict[str, Int64] = {}
        for name, group in groups_of(source).items():
            if len(group.nodes):
                point_sets[name] = group.nodes
            if name in titles.values() and _is_told(group, source.cells, labels or (), *named[name]):
                continue
            titles = {key: title for key, title in titles.items() if title != name}
            if group.cells:
                mine = {id(run): rows for run, rows in group.cells}
                sets[name] = [mine.get(id(run), np.empty(0, dtype=np.int64)) for run in source.cells]
        for name, key in _regions_of_sets(sets, source.cells, labels or ()).items():
            if key not in titles:
                titles[key] = name
                del sets[name]
        nodes, elements = numbers_of_nodes(source), [numbers_of(run) for run in source.cells]
        nodes = np.arange(1, len(points) + 1) if nodes is None else nodes
        return cls(points, source.cells, nodes, elements, labels, titles, sets, point_sets, arrays, region)

    def title(self, dimension: int, number: int) -> str:
        """Return what a material is called; one without a name by its number."""
        return self.titles.get((dimension, number), f"region_{number}")

    def parts(self) -> Iterator[tuple[Cells, int, Int64]]:
        """Give for each material of each run its number, 0 where there is none, and the rows (k,) of its cells."""
        for i, run in enumerate(self.cells):
            labels = np.zeros(len(run.vertices), dtype=np.int64) if self.regions is None else self.regions[i]
            for number in np.unique(labels).tolist():
                yield run, number, np.flatnonzero(labels == number)

    def nodes_of(self, vertices: NDArray[np.integer[Any]]) -> Int64:
        """Return the numbers (m, k) of vertices; 0 where there is none."""
        return np.append(self.nodes, 0)[vertices]

    def refusal(self, form: Format) -> WriteError:
        """Return what is raised where a format has none of the cells."""
        return WriteError(f"cannot be written as {form.name}: that holds no {words(self.cells[0].type)[1]}")

    @property
    def dimension(self) -> int:
        """The highest of the cells."""
        return max((dimension_of(run.type) for run in self.cells), default=0)

    def in_space(self) -> NDArray[np.float64]:
        """Return the points (n, 3)."""
        points = np.asarray(self.points, dtype=np.float64)
        return points if points.shape[1] == 3 else np.column_stack([points, np.zeros(len(points))])


def words_of(
    names: Sequence[str],
    allowed: str = r"\w.+-",
    longest: int = 80,
    lower: bool = False,
    spelled: Callable[[str], str] = str,
) -> dict[str, str]:
    """Return what names become where a format allows few characters: no two the same, but for blanks around them.

    Parameters
    ----------
    allowed : str
        The characters, as in a class of a regular expression; of others an underscore stands for each run.
    longest : int
        How many bytes there may be.
    lower : bool
        Capital letters are none of their own.
    spelled : callable
        What is done with a name before that.
    """
    found: dict[str, str] = {}
    taken = set()
    for name in names:
        first = re.sub(rf"[^{allowed}]+", "_", spelled(name)) or "_"
        word, count = _cut(first, longest), 1
        while (key := (word.lower() if lower else word).strip()) in taken:
            count += 1
            end = f"_{count}"
            word = _cut(first, longest - len(end)) + end
        taken.add(key)
        found[name] = word
    return found


def _cut(text: str, longest: int) -> str:
    """Return as many characters as so many bytes hold."""
    return text.encode()[:longest].decode(errors="ignore")


def _is_told(group: Group, cells: Sequence[Cells], labels: Sequence[Int64], dimension: int, number: int) -> bool:
    """Whether the cells of a group are those of its number, and no others: cells that are in several have one."""
    mine = [values for run, values in zip(cells, labels, strict=True) if dimension_of(run.type) == dimension]
    return sum(len(rows) for _, rows in group.cells) == sum(int((np.abs(values) == number).sum()) for values in mine)


def _regions_of_sets(
    sets: Mapping[str, Sequence[Int64]], cells: Sequence[Cells], labels: Sequence[Int64]
) -> dict[str, tuple[int, int]]:
    """Return the dimension and the number of the material of which a set has all cells, and no others."""
    found: dict[str, tuple[int, int]] = {}
    sizes: dict[tuple[int, int], int] = {}
    for run, values in zip(cells, labels, strict=False):
        for number, count in zip(*(one.tolist() for one in np.unique(values, return_counts=True)), strict=True):
            key = dimension_of(run.type), number
            sizes[key] = sizes.get(key, 0) + count
    for name, runs in sets.items() if sizes else ():
        keys = {
            (dimension_of(cells[i].type), one) for i, rows in enumerate(runs) for one in set(labels[i][rows].tolist())
        }
        key = keys.pop() if len(keys) == 1 else (0, 0)
        if key[1] and sizes[key] == sum(map(len, runs)):
            found[name] = key
    return found


def _whole(runs: Sequence[NDArray[Any]]) -> list[Int64]:
    """Return labels as whole numbers: as they are, or numbered where they are none."""
    if all(values.dtype.kind in "biu" or (np.isfinite(values) & (values == np.round(values))).all() for values in runs):
        return [values.astype(np.int64) for values in runs]
    ends = np.cumsum([len(values) for values in runs])[:-1]
    return np.split(np.unique(np.concatenate(runs), return_inverse=True)[1].astype(np.int64) + 1, ends)
