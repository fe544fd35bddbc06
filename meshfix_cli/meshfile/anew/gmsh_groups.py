"""Which physical groups and entities of gmsh stand for the materials and sets of a mesh.

Source: "Gmsh Reference Manual", section "Elementary entities vs. physical groups".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.anew.content import Content, Int64
from meshfix_cli.meshfile.gmsh import ENTITY

_LARGEST = 2**31 - 1


@dataclass(frozen=True, eq=False)
class Groups:
    """Numbers for the elements.

    Attributes
    ----------
    physical, entities : sequence of (m,) int64
        For each run the first group of each element, 0 where it is in none, and its entity, from 1.
    groups : dict
        The numbers of all groups of each entity, which is a dimension and a number.
    titles : list of (int, int, str)
        Dimension, number and name of groups.
    """

    physical: Sequence[Int64]
    entities: Sequence[Int64]
    groups: dict[tuple[int, int], tuple[int, ...]]
    titles: list[tuple[int, int, str]]


class _Piece(NamedTuple):
    """Elements of a run that are alike: their entity in the input, their material, the numbers of their sets."""

    entity: int
    label: int
    sets: tuple[int, ...] = ()

    @property
    def groups(self) -> tuple[int, ...]:
        """All groups, that of the material first."""
        return tuple(dict.fromkeys((self.label,) * (self.label != 0) + self.sets))


def groups_of(content: Content, several: bool) -> Groups:
    """Give materials their numbers, and sets those that are left.

    Parameters
    ----------
    several : bool
        An element may be in several groups. Else a set is left out that has some of the elements of another group.
    """
    labels, numbers = _labels(content)
    titles = [(dimension, numbers.get(label, label), name) for (dimension, label), name in content.titles.items()]
    sets = _numbers_of_sets(content, {*numbers.values(), *(number for _, number, _ in titles)})
    codes, pieces = _pieces(content, labels, sets)
    dimensions = [dimension_of(run.type) for run in content.cells]
    if several:
        groups = [[piece.groups for piece in mine] for mine in pieces]
        titles += [(dimension, number, name) for (name, dimension), number in sets.items()]
    else:
        groups, names = _one_each(content, pieces, dimensions, sets)
        titles += names
    entities, of_entities = _entities(pieces, groups, dimensions)
    firsts = [[(*one, 0)[0] for one in mine] for mine in groups]
    return Groups(_of_cells(firsts, codes), _of_cells(entities, codes), of_entities, titles)


def _of_cells(values: Sequence[Sequence[int]], codes: Sequence[Int64]) -> list[Int64]:
    return [np.array(mine, dtype=np.int64)[code] for mine, code in zip(values, codes, strict=True)]


def _labels(content: Content) -> tuple[Sequence[Int64], dict[int, int]]:
    """Return the number of the material of each cell, and those of all materials: they stay where gmsh has such."""
    if content.regions is None:
        return [np.zeros(len(run.vertices), dtype=np.int64) for run in content.cells], {}
    used = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *content.regions]))
    if len(used) and (used[0] < 0 or used[-1] > _LARGEST):
        new = np.arange(len(used)) + (used[0] != 0)
        return [new[np.searchsorted(used, values)] for values in content.regions], dict(
            zip(used.tolist(), new.tolist(), strict=True)
        )
    return content.regions, {number: number for number in used.tolist()}


def _numbers_of_sets(content: Content, taken: set[int]) -> dict[tuple[str, int], int]:
    """Number the sets, by their names and the dimensions of their cells: as the input does, or behind all others."""
    numbers: dict[tuple[str, int], int] = {}
    own = {name: np.asarray(about).ravel().tolist() for name, about in content.arrays.groups.items()}
    for name, runs in content.sets.items():
        there = {dimension_of(run.type) for run, rows in zip(content.cells, runs, strict=True) if len(rows)}
        for dimension in sorted(there):
            number = own[name][0] if name in own and own[name][1:] == [dimension] else 0
            if not 0 < number <= _LARGEST or (number, dimension) in ((n, d) for (_, d), n in numbers.items()):
                number = max([0, *taken, *(about[0] for about in own.values() if len(about) == 2)]) + 1
            taken.add(number)
            numbers[name, dimension] = number
    return numbers


def _pieces(
    content: Content, labels: Sequence[Int64], sets: dict[tuple[str, int], int]
) -> tuple[list[Int64], list[list[_Piece]]]:
    """Return for each run what tells its elements apart, and for each of them (m,) which of these it is."""
    own = content.arrays.cell.get(ENTITY)
    codes, pieces = [], []
    for i, run in enumerate(content.cells):
        entities = np.zeros(len(labels[i]), dtype=np.int64) if own is None else np.asarray(own[i], dtype=np.int64)
        (known, code), (materials, of_material) = _numbered(entities), _numbered(labels[i])
        code = code * len(materials) + of_material
        mine = [_Piece(entity, label) for entity in known.tolist() for label in materials.tolist()]
        for name, runs in content.sets.items():
            if len(rows := runs[i]):
                number = sets[name, dimension_of(run.type)]
                before, inverse = _numbered(code[rows])
                code[rows] = len(mine) + inverse
                mine += [mine[one]._replace(sets=(*mine[one].sets, number)) for one in before.tolist()]
        used, code = _numbered(code)
        codes.append(code)
        pieces.append([mine[one] for one in used.tolist()])
    return codes, pieces


def _numbered(values: Int64) -> tuple[Int64, Int64]:
    """Return the different values, ascending, and for each value (m,) which of these it is."""
    low, high = (int(values.min()), int(values.max())) if len(values) else (0, -1)
    if high - low > 2 * len(values):
        known, codes = np.unique(values, return_inverse=True)
        return known, codes.reshape(-1)
    there = np.bincount(values - low, minlength=high - low + 1) > 0
    return np.flatnonzero(there) + low, (np.cumsum(there) - 1)[values - low]


def _one_each(
    content: Content, pieces: Sequence[Sequence[_Piece]], dimensions: Sequence[int], sets: Mapping[tuple[str, int], int]
) -> tuple[list[list[tuple[int, ...]]], list[tuple[int, int, str]]]:
    """Return the one group of each piece, and the names of sets that are whole groups; small sets come first."""
    group = {(i, j): piece.label for i, mine in enumerate(pieces) for j, piece in enumerate(mine)}
    titles: list[tuple[int, int, str]] = []
    for name in sorted(content.sets, key=lambda name: sum(map(len, content.sets[name]))):
        named: dict[tuple[int, int], tuple[int, int]] = {}
        for dimension, number in ((key[1], number) for key, number in sets.items() if key[0] == name):
            alike = [at for at in group if dimensions[at[0]] == dimension]
            mine = [at for at in alike if number in pieces[at[0]][at[1]].sets]
            before = {group[at] for at in mine}
            if before != {0} and (len(before) > 1 or sum(group[at] in before for at in alike) > len(mine)):
                break
            named |= dict.fromkeys(mine, (dimension, before.pop() or number))
        else:
            group |= {at: number for at, (_, number) in named.items()}
            titles += [(*key, name) for key in dict.fromkeys(named.values())]
    return [[(group[i, j],) * (group[i, j] != 0) for j in range(len(mine))] for i, mine in enumerate(pieces)], titles


def _entities(
    pieces: Sequence[Sequence[_Piece]], groups: Sequence[Sequence[tuple[int, ...]]], dimensions: Sequence[int]
) -> tuple[list[list[int]], dict[tuple[int, int], tuple[int, ...]]]:
    """Number the entities, those of one dimension from 1, or as the input does where each has the same groups.

    The second value tells the groups of each.
    """
    found: dict[tuple[int, int], set[tuple[int, ...]]] = {}
    for dimension, mine, numbers in zip(dimensions, pieces, groups, strict=True):
        for piece, group in zip(mine, numbers, strict=True):
            found.setdefault((dimension, piece.entity), set()).add(group)
    kept = all(0 < entity <= _LARGEST and len(different) == 1 for (_, entity), different in found.items())
    if kept:
        own = [[piece.entity for piece in mine] for mine in pieces]
        return own, {key: next(iter(different)) for key, different in found.items()}
    tags: dict[tuple[int, tuple[int, ...]], int] = {}
    counts: dict[int, int] = {}
    for dimension, numbers in zip(dimensions, groups, strict=True):
        for group in numbers:
            if (dimension, group) not in tags:
                counts[dimension] = tags[dimension, group] = counts.get(dimension, 0) + 1
    entities = [[tags[d, group] for group in numbers] for d, numbers in zip(dimensions, groups, strict=True)]
    return entities, {(dimension, tag): group for (dimension, group), tag in tags.items()}
