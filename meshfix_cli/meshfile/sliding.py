"""What of a file keeps the shape of its boundary, and which vertices may slide without changing that."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import counted, element_of
from meshfix_cli.mesh.freedom import constraints_of, freedom_of
from meshfix_cli.mesh.mesh import BETWEEN, ON_BOUNDARY
from meshfix_cli.meshfile.coincident import first_of_each_place
from meshfix_cli.meshfile.document import BY_FILE, ON_CELLS, Document

if TYPE_CHECKING:
    from meshfix_cli.mesh.curved import Smooth
    from meshfix_cli.mesh.freedom import Freedom
    from meshfix_cli.mesh.mesh import Mesh

MOST = 0.5  # of the vertices of a surface or curve
Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]


def slid(
    document: Document,
    interfaces: bool = True,
    reference: NDArray[np.float64] | None = None,
    tangled: bool = True,
    smooth: Smooth | None = None,
) -> Document:
    """Return a document of which the flat boundary may slide.

    Parameters
    ----------
    document : Document
    interfaces : bool
        Whether interfaces between regions may as well.
    reference : (k, d) float64, optional
        Where the vertices, in the order of the connectivity, were before the boundary moved: it tells planes and edges.
    tangled : bool
        Whether the boundary may be tangled; see `constraints_of`.
    smooth : Smooth, optional
        Let vertices slide on curved surfaces and along curves, too: those that are there.
    """
    mesh, topology = document.mesh, document.mesh.topology
    now = mesh.along_curve(mesh.points)
    points = now if reference is None else reference
    code = joint(topology.m, *document.regions) if document.regions else None
    constraints = constraints_of(topology, points, code, tangled)
    cells = CellsBeside(document, constraints.facets)
    labels = joint(len(constraints.facets), constraints.labels, cells.labels) if cells.facets else constraints.labels
    freedom = freedom_of(points, replace(constraints, labels=labels, lines=cells.lines), smooth)
    freedom = replace(freedom, stays=reference is None)
    held = cells.held | twins(document, None if reference is None else topology.of_vertices(reference))
    if document.ties is not None:
        held = document.ties.with_corners(held)
    if reference is not None:
        held |= topology.of_vertices(freedom.turned(reference, now))
    if smooth is not None:
        held |= topology.of_vertices(_moved(freedom, now, smooth.bound))
    for reason, mask in document.holds.items():
        if reason not in (ON_BOUNDARY, ON_CELLS) and not (interfaces and reason.startswith(BETWEEN)):
            held |= mask
    return replace(document, mesh=mesh.sliding(freedom, held))


def _moved(freedom: Freedom, points: NDArray[np.float64], bound: float) -> Mask:
    """Mark the vertices (k,) that are off their shapes, and all of a shape from which most are: it has moved.

    Those few of it that lie where it was, as two circles cross each other, would go back there.
    """
    off = freedom.rounded(points)[1] > bound
    on_shape = np.flatnonzero(freedom.frame >= 0)
    shapes = freedom.frame[on_shape]
    has_moved = np.bincount(shapes, off[on_shape]) > MOST * np.bincount(shapes)
    off[on_shape] |= has_moved[shapes]
    return off


def held_back(document: Document, after: Mesh, feature_angle: float) -> Iterator[str]:
    """Say what of the boundary did not slide, and whether that is what limits the mesh that came of it."""
    mesh = document.mesh
    assert mesh.freedom is not None
    slides = mesh.topology.of_vertices(mesh.freedom.frame >= 0)
    count = int((document.holds.get(BY_FILE, False) & slides & ~mesh.movable).sum())
    if count:
        stay = counted(count, "vertex of the boundary does", "vertices of the boundary do")
        yield f"{stay} not slide: the file fixes them or pairs them with others, as where it is periodic"
    if mesh.freedom.shapes is None or mesh.freedom.shapes.folds or mesh.surface is not None:  # folds feign edges
        return
    inverted = after.judged().check(after.along_curve(after.points), 1)[0]
    corners = mesh.topology.boundary & mesh.topology.of_vertices(mesh.freedom.frame < 0)
    for reason, mask in document.holds.items():
        if reason not in (ON_BOUNDARY, ON_CELLS):
            corners = corners & ~mask
    bound = np.append(mesh.along_curve(corners) | (mesh.freedom.degrees == 1), False)
    at_features = np.zeros(mesh.topology.m, dtype=bool)
    for block in mesh.topology.blocks:
        at_features[block.rows] = bound[mesh.topology.number[block.vertices]].any(axis=1)
    count = int(at_features[mesh.topology.connectivity.rows[inverted]].sum())
    if count:
        are = counted(count, "element that remains inverted is", "elements that remain inverted are")
        yield (
            f"{are} at edges or corners of the shape, where vertices slide along an edge or stay; with a larger "
            f"--feature-angle than {feature_angle:g} there are fewer of these"
        )


def joint(count: int, *values: NDArray[np.integer]) -> Int64:
    """Return one number for each that some arrays (count,) have together; 0 where there are none."""
    code = np.zeros(count, dtype=np.int64)
    for one in values:
        _, place = np.unique(one, return_inverse=True)
        _, code = np.unique(code * (int(place.max(initial=0)) + 1) + place.reshape(-1), return_inverse=True)
        code = code.reshape(-1)
    return code


def twins(document: Document, before: NDArray[np.float64] | None = None) -> Mask:
    """Mark the points (n,) of the boundary that lie at one place with others: what touches there may be in contact.

    Where they were (n, d) before the boundary moved, they did so as well: a tangle puts one upon another.
    """
    points = document.mesh.points if before is None else np.hstack([document.mesh.points, before])
    first = first_of_each_place(points, np.flatnonzero(document.mesh.topology.boundary))
    copies = first != np.arange(len(first))
    copies[first[copies]] = True
    return copies


class CellsBeside:
    """The cells of the file that are not solved for, as they keep the shape of the mesh.

    Attributes
    ----------
    facets : bool
        Whether there are any of the first.
    labels : (f,) int64
        For each facet a number for the tags and sets of the cell that lies on it; 0: there is none.
    lines : (l, 2) int32
        Those in space, in the numbers of the connectivity.
    held : (n,) bool
        Points of all cells that are neither facets nor lines.
    """

    def __init__(self, document: Document, facets: NDArray[np.int32]) -> None:
        mesh, topology = document.mesh, document.mesh.topology
        solved = {part.run for part in document.solved.parts}
        runs = [i for i, run in enumerate(document.source.cells) if i not in solved and len(run.vertices)]
        space = mesh.points.shape[1]
        flat = [i for i in runs if mesh.surface is None and _is_straight(document, i, space - 1)]
        lines = [i for i in runs if space == 3 and _is_straight(document, i, 1)]
        self.held = np.zeros(topology.n, dtype=bool)
        for run in (document.source.cells[i] for i in runs if i not in (*flat, *lines)):
            self._hold(np.concatenate([np.ravel(row) for row in run.vertices]).astype(np.int64))
        self.lines = np.empty((0, 2), dtype=np.int32)
        for i in lines:
            self.lines = np.concatenate([self.lines, self._in_mesh(document, i)])
        self.facets, self.labels = bool(flat), np.zeros(len(facets), dtype=np.int64)
        if flat:
            self._find(document, facets, flat)

    def _hold(self, vertices: Int64) -> None:
        self.held[vertices[(vertices >= 0) & (vertices < len(self.held))]] = True

    def _in_mesh(self, document: Document, run: int) -> NDArray[np.int32]:
        """Return the corners of the cells (c, w) of a run in the numbers of the connectivity.

        Those with other points are held.
        """
        topology, cells = document.mesh.topology, document.source.cells[run]
        element = element_of(cells.type)
        vertices = np.asarray(cells.vertices)[:, : None if element is None else element.shape.corners]
        inside = (vertices >= 0) & (vertices < topology.n)
        used = np.asarray((topology.used[np.where(inside, vertices, 0)] & inside).all(axis=1))
        self._hold(vertices[~used].ravel())
        return topology.number[vertices[used]]

    def _find(self, document: Document, facets: NDArray[np.int32], runs: list[int]) -> None:
        """Give facets the labels of the cells that lie on them; the points of other cells are held."""
        rows, labels = [_ascending(facets)], [np.zeros(len(facets), dtype=np.int64)]
        tags = _tags(document, runs)
        for i, tag in zip(runs, tags, strict=True):
            cells = self._in_mesh(document, i)
            whole = len(cells) == len(tag)  # else which of them are left is not known
            rows.append(_ascending(cells))
            labels.append(tag + 1 if whole else np.ones(len(cells), dtype=np.int64))
        every, label = np.concatenate(rows), np.concatenate(labels)
        order = np.lexsort((label == 0, *every.T))  # facets behind the cells that lie on them
        same = (every[order[1:]] == every[order[:-1]]).all(axis=1)
        place = np.cumsum(np.concatenate([[True], ~same])) - 1
        found = np.zeros(int(place.max()) + 1, dtype=np.int64)
        np.maximum.at(found, place, label[order])
        is_facet = np.zeros(len(found), dtype=bool)
        is_facet[place[order < len(facets)]] = True
        mine = order < len(facets)
        self.labels[order[mine]] = found[place[mine]]
        lost = every[order[~mine & ~is_facet[place]]]
        self._hold(document.mesh.topology.connectivity.vertices[lost[lost >= 0]].astype(np.int64))


def _is_straight(document: Document, run: int, dimension: int) -> bool:
    """Whether cells have a dimension and no other nodes than corners, or such as follow those of elements."""
    cells = document.source.cells[run]
    element = element_of(cells.type)
    if element is None or not element.shape.corners or element.shape.dimension != dimension:
        return False
    others = np.asarray(cells.vertices)[:, element.shape.corners :]
    inside = (others >= 0) & (others < document.mesh.topology.n)
    return element.linear or (document.ties is not None and bool(inside.all() and document.ties.nodes[others].all()))


def _ascending(rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return rows of vertices, at most four, each ascending, filled up with -1 at the front."""
    filled = np.full((len(rows), 4), -1, dtype=np.int32)
    filled[:, : rows.shape[1]] = rows
    filled.sort(axis=1)
    return filled


def _tags(document: Document, runs: list[int]) -> list[Int64]:
    """Return a number for each cell of some runs that stands for its regions and sets."""
    source = document.source
    ends = np.cumsum([len(source.cells[i].vertices) for i in runs])
    columns: list[NDArray[np.integer]] = []
    for key in source.regions:
        values = np.concatenate([np.asarray(source.arrays.cell[key][i]) for i in runs])
        if values.ndim == 1:
            columns.append(np.unique(values, return_inverse=True)[1].reshape(-1))
    for rows_of_runs in source.arrays.cell_sets.values():
        member = np.zeros(ends[-1], dtype=np.int64)
        for begin, i in zip((0, *ends[:-1]), runs, strict=True):
            member[begin + np.asarray(rows_of_runs[i], dtype=np.int64)] = 1
        columns.append(member)
    return np.split(joint(int(ends[-1]), *columns), ends[:-1])
