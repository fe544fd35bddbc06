"""What is solved for of the cells of a file: all elements of its highest dimension, by their corners.

Some have more nodes than corners; where these lie between the corners, they follow them. Cells that
other programs number in their own way, pixels, voxels and strips of triangles, become what they are, and so
do cells that name a vertex several times: a hexahedron of which two opposite faces have lost an edge is a wedge.

Source: VTK, "vtkCellType.h"; for the repeated nodes "LS-DYNA Keyword User's Manual", *ELEMENT_SOLID, and "Ansys
Mechanical APDL Element Reference", SOLID185, whose rules are cases of the one that is applied here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, permutations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import (
    COLLAPSED,
    ELEMENTS,
    JUDGED,
    SIMPLICES,
    Element,
    dimension_of,
    element_of,
    straight_key,
)
from meshfix_cli.meshfile.source import Cells
from meshfix_cli.meshfile.splice import Turned

if TYPE_CHECKING:
    from meshfix_cli.mesh.ties import Ties

Int64 = NDArray[np.int64]
Facet = tuple[int, ...]

_STRIP = "triangle_strip"
# Types with an order of their own: what they are, and which of their vertices stands where.
_REORDERED = {"pixel": ("quad", (0, 1, 3, 2)), "voxel": ("hexahedron", (0, 1, 3, 2, 4, 5, 7, 6))}
_SIMPLICES = frozenset(element.key for element in SIMPLICES.values())


@dataclass(frozen=True, eq=False)
class Part:
    """Elements of one type that lie in one run of cells.

    Attributes
    ----------
    key : str
        The type, one of `elements.JUDGED`.
    vertices : (k, corners) int
    run : int
        The number of the run.
    rows : (k,) int64 or None
        Which cells of the run they are; None: all, one by one.
    refined : Element or None
        The type of the cells, where these have more nodes than corners.
    nodes : (k, nodes) int or None
        All of their nodes then.
    """

    key: str
    vertices: NDArray[np.integer[Any]]
    run: int
    rows: Int64 | None = None
    refined: Element | None = None
    nodes: NDArray[np.integer[Any]] | None = None

    @property
    def type(self) -> str:
        """The type of the cells, but for collapsed ones, which are called after what is left of their corners."""
        return self.key if self.refined is None or self.refined.straight != ELEMENTS[self.key] else self.refined.key

    def at(self, here: NDArray[np.integer[Any]]) -> Part:
        """Return some of the elements, by their positions."""
        rows = here.astype(np.int64, copy=False) if self.rows is None else self.rows[here]
        nodes = None if self.nodes is None else self.nodes[here]
        return replace(self, vertices=self.vertices[here], rows=rows, nodes=nodes)


@dataclass(frozen=True, eq=False)
class Solved:
    """The elements that are solved for, numbered through their parts, and the cells that are not.

    Attributes
    ----------
    parts : tuple of Part
        In the order of the runs, and within a run by type.
    rest : tuple of Cells
        Facets, lines, elements of other types, and collapsed ones of no type.
    """

    parts: tuple[Part, ...]
    rest: tuple[Cells, ...]

    @property
    def dimension(self) -> int:
        """2 or 3; 0: there is nothing to solve."""
        return dimension_of(self.parts[0].key) if self.parts else 0

    @property
    def blocks(self) -> Any:
        """What `Mesh.build` takes: simplices (m, d+1) where there is nothing else, or pairs of a type and its rows."""
        if {part.key for part in self.parts} <= _SIMPLICES:
            return _joined([part.vertices for part in self.parts])
        return [(part.key, part.vertices) for part in self.parts]

    @property
    def m(self) -> int:
        """Number of elements."""
        return sum(len(part.vertices) for part in self.parts)

    def starts(self) -> Int64:
        """Return the number of the first element of each part, and that of all elements behind them."""
        return np.cumsum([0, *(len(part.vertices) for part in self.parts)])

    def some(self, elements: NDArray[np.integer[Any]]) -> tuple[Part, ...]:
        """Return some elements (k,), ascending."""
        starts = self.starts()
        ends, found = np.searchsorted(elements, starts), []
        for i, part in enumerate(self.parts):
            here = elements[ends[i] : ends[i + 1]] - starts[i]
            found.append(part if len(here) == len(part.vertices) else part.at(here))
        return tuple(found)

    def of_elements(self, values: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Return values of the cells of each run as those (m, ...) of the elements."""
        return _joined([values[part.run] if part.rows is None else values[part.run][part.rows] for part in self.parts])

    def vertices(self) -> Int64:
        """Return the vertices of all elements, one behind the other."""
        return _joined([part.vertices.ravel() for part in self.parts])

    def nodes(self) -> Int64:
        """Return the same with the nodes that elements have between these."""
        return _joined([(part.vertices if part.nodes is None else part.nodes).ravel() for part in self.parts])

    def ties(self, points: NDArray[np.floating[Any]]) -> tuple[Ties | None, NDArray[np.bool_]]:
        """Find the nodes that follow corners, None: there are none, and mark the curved elements (m,).

        Those are not what their corners tell: at points (n, d) they have a node elsewhere than between these.

        Raises
        ------
        InvalidMeshError
            See `ties.ties_of` and `ties.curved`.
        """
        if all(part.nodes is None for part in self.parts):
            return None, np.zeros(self.m, dtype=bool)
        from meshfix_cli.mesh.ties import curved, ties_of

        blocks = [
            (part.refined or ELEMENTS[part.key], part.vertices if part.nodes is None else part.nodes)
            for part in self.parts
        ]
        ties, at_odds = ties_of(blocks, len(points))
        return ties, at_odds | curved(blocks, ties, points)

    def not_judged(self) -> dict[str, int]:
        """Count, by their types, the cells of the mesh's dimension that are not solved for."""
        counts: dict[str, int] = {}
        for run in self.rest:
            if len(run.vertices) and dimension_of(run.type) == self.dimension:
                counts[run.type] = counts.get(run.type, 0) + len(run.vertices)
        return counts

    def groups(self) -> Int64:
        """Number the elements (m,) so that those of one type with the same vertices have one number."""
        starts, groups, known = self.starts(), np.empty(self.m, dtype=np.int64), 0
        for key in dict.fromkeys(part.key for part in self.parts):
            mine = [i for i, part in enumerate(self.parts) if part.key == key]
            rows = np.sort(_joined([self.parts[i].vertices for i in mine]), axis=1)
            where = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in mine])
            groups[where] = known + np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
            known += int(groups[where].max(initial=-1)) + 1 - known
        return groups

    def odd(self) -> NDArray[np.bool_]:
        """Mark the elements (m,) so that two of one group are marked alike if they are numbered the same way round."""
        return np.concatenate([_odd(part) for part in self.parts])


def solved_runs(cells: Sequence[Cells]) -> list[int]:
    """Return the numbers of the runs that hold what is solved for."""
    filled = [i for i, run in enumerate(cells) if len(run.vertices)]
    highest = max((dimension_of(cells[i].type) for i in filled), default=0)
    return [i for i in filled if dimension_of(cells[i].type) == highest and _key_of(cells[i].type)]


def solved_of(cells: Sequence[Cells]) -> Solved:
    """Find the elements that are solved for.

    Those that name a vertex twice and are of no type without it, or nothing at all, are among the rest.
    """
    chosen = solved_runs(cells)
    rest = [run for i, run in enumerate(cells) if i not in chosen]
    parts: list[Part] = []
    for i in chosen:
        for part in _parts(_plainly(cells[i], i)):
            if part.key in ELEMENTS and ELEMENTS[part.key].judged_by:
                parts.append(part)
            else:
                rest.append(Cells(part.key, part.vertices if part.nodes is None else part.nodes))
    return Solved(tuple(parts), tuple(rest))


def _key_of(kind: str) -> str | None:
    """Return what cells of a type are solved as: a key of `elements.JUDGED`, or a type of VTK's; None: as nothing."""
    return kind if kind in _REORDERED or kind == _STRIP else straight_key(kind)


def ids_of(run: Cells, start: int) -> Int64:
    """Return the numbers of cells: those of the file, or positions among all of its cells, from that of the first."""
    return np.arange(start, start + len(run.vertices)) if run.ids is None else run.ids


def turned(cells: Sequence[Cells], rows: Mapping[int, Int64]) -> dict[int, Turned]:
    """Return the cells in some rows of runs with the order of vertices that has the other orientation.

    Raises
    ------
    ReadError
        They are strips of triangles, which have no such order.
    """
    found = {}
    for run, here in rows.items():
        key, _ = _REORDERED.get(cells[run].type, (cells[run].type, ()))
        element = element_of(key)
        if len(here) and (key == _STRIP or element is None):
            raise ReadError("has strips of triangles, of which none can be renumbered alone")
        if len(here) and element is not None:
            found[run] = Turned(np.sort(here), element.mirrored)
    return found


def in_common_types(run: Cells) -> Cells:
    """Return pixels and voxels, which only VTK has, as quadrilaterals and hexahedra; other cells as they are."""
    if run.type not in _REORDERED:
        return run
    key, order = _REORDERED[run.type]
    return Cells(key, run.vertices[:, order], run.ids, run.ghosts)


def _plainly(run: Cells, number: int) -> Part:
    """Return the cells of a run as elements of the type that they have when no vertex is repeated."""
    if run.type == _STRIP:
        return _of_strips(run.vertices, number)
    common = in_common_types(run)
    element = element_of(common.type)
    if element is None or element.straight in (None, element):
        return Part(common.type, common.vertices, number)
    corners = common.vertices[:, : element.shape.corners]
    return Part(element.straight.key, corners, number, refined=element, nodes=common.vertices)


def _of_strips(strips: NDArray[np.integer[Any]], number: int) -> Part:
    """Cut strips (k, size) into triangles; those that name a vertex twice only lead a strip elsewhere."""
    first = np.arange(max(strips.shape[1] - 2, 0))[:, None]
    triangles = strips[:, first + np.where(first % 2, [0, 2, 1], [0, 1, 2])].reshape(-1, 3)
    rows = np.repeat(np.arange(len(strips)), len(first))
    kept = ~_repeats(triangles)
    return Part("triangle", triangles[kept], number, rows[kept])


def _parts(part: Part) -> Iterator[Part]:
    """Divide elements by what they are without the vertices that they name twice."""
    repeated = _repeats(part.vertices)
    if not repeated.any():
        yield part
        return
    if not repeated.all():
        yield part.at(np.flatnonzero(~repeated))
    at = np.flatnonzero(repeated)
    # For each vertex the position where the element names it first.
    first = (part.vertices[at][:, :, None] == part.vertices[at][:, None, :]).argmax(axis=2)
    patterns, which = np.unique(first, axis=0, return_inverse=True)
    which = which.reshape(-1)
    found: dict[str, list[tuple[Int64, NDArray[np.integer[Any]]]]] = {}
    for i, pattern in enumerate(patterns.tolist()):
        here = at[which == i]
        key, order = _without_repetitions(part.key, tuple(pattern))
        found.setdefault(key, []).append((here, part.vertices[here][:, order]))
    for key, pieces in found.items():
        if len({vertices.shape[1] for _, vertices in pieces}) > 1:  # collapsed ones of no type
            yield from (replace(part.at(here), key=key, vertices=vertices) for here, vertices in pieces)
            continue
        here = np.concatenate([here for here, _ in pieces])
        ascending = np.argsort(here)
        vertices = np.concatenate([vertices for _, vertices in pieces])
        yield replace(part.at(here[ascending]), key=key, vertices=vertices[ascending])


def _repeats(vertices: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """Mark the rows (k,) that name a vertex twice."""
    found = np.zeros(len(vertices), dtype=bool)
    for one, other in combinations(range(vertices.shape[1]), 2):
        found |= vertices[:, one] == vertices[:, other]
    return found


@cache
def _without_repetitions(key: str, first: tuple[int, ...]) -> tuple[str, list[int]]:
    """Return what an element is of which some nodes are others, and the positions of the nodes of that.

    Parameters
    ----------
    key : str
    first : tuple of int
        For each node the first one that is the same.

    Returns
    -------
    key : str
        A type of the same dimension, or that of collapsed elements that are of none, or have no size.
    order : list of int
    """
    shape = ELEMENTS[key].shape
    facets = _remaining([tuple(first[node] for node in facet) for facet in shape.facets], shape.dimension)
    nodes = sorted(set(first))
    sizes = sorted(map(len, facets))
    for element in JUDGED:
        if element.nodes == len(nodes) and sorted(map(len, element.shape.facets)) == sizes:
            for order in permutations(nodes):
                if {_turned(tuple(order[node] for node in facet)) for facet in element.shape.facets} == facets:
                    return element.key, list(order)
    return f"{COLLAPSED}{shape.name}", nodes


def _remaining(facets: Sequence[Facet], dimension: int) -> set[Facet]:
    """Return the facets of which enough nodes are left, but for pairs that lie on one another."""
    short = [tuple(a for a, b in zip(one, (*one[1:], one[0]), strict=True) if a != b) for one in facets]
    whole = {_turned(one) for one in short if len(set(one)) == len(one) >= dimension}
    return {one for one in whole if _turned(one[::-1]) not in whole}


def _turned(facet: Facet) -> Facet:
    """Return a facet from its smallest node on; edges have two ends, and keep them."""
    at = facet.index(min(facet)) if len(facet) > 2 else 0
    return (*facet[at:], *facet[:at])


def _odd(part: Part) -> NDArray[np.bool_]:
    """Mark elements (k,) by the parity of the corner simplex at their smallest vertex."""
    corners = np.array(ELEMENTS[part.key].shape.simplices)
    at = np.argmin(part.vertices[:, corners[:, 0]], axis=1)
    simplices = np.take_along_axis(part.vertices, corners[at], axis=1)
    pairs = np.triu_indices(simplices.shape[1], 1)
    return (simplices[:, pairs[0]] > simplices[:, pairs[1]]).sum(axis=1) % 2 == 1


def _joined(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
