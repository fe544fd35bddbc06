"""What pages and plots show of a report, found out once: the mesh as pictures, the worst elements, the convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.mixed import MixedTopology
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.summary import WITHIN, Summary, worst_first
from meshfix_cli.report.curves import Curves
from meshfix_cli.report.facts import Report, centroids, names
from meshfix_cli.solve.records import SweepRecord
from meshfix_cli.solve.strategies import SMOOTHING

WORST = 10  # elements of the result that are named and marked
MOST_CELLS = 100_000  # elements of a plane mesh that are all drawn
MOST_INVERTED = 20_000  # inverted elements that are drawn of each stage
MOST_FACETS = 150_000  # of the boundary; above it is drawn on a grid, which has so many cells along its longest side:
GRID = 512
THINNEST = 1e-3  # extent of a picture, relative to the largest
CREASE = 30.0  # degrees between two facets of the boundary, above which their edge is drawn

# What facets are drawn as that are farther from their shape than a share of the deviation that is allowed.
OFF = (("near", 0.1), ("off", 0.5), ("beyond", WITHIN))

Points = NDArray[np.float64]
Rows = NDArray[np.int32]
Cells = Mapping[str, Rows]  # vertices (m, nodes) of elements, by their type
FACETS = {2: "line", 3: "triangle", 4: "quad"}  # by the number of their vertices


@dataclass(frozen=True, eq=False)
class State:
    """The elements that are drawn of one stage.

    Attributes
    ----------
    points : (k, d) float64
        In model units, as the solver has them.
    cells, inverted, worst : dict of (m, nodes) int32
        Rows of `points`: all elements where they can all be drawn, those inverted, the worst (of the result alone).
    left_out : int
        Inverted elements that are not drawn.
    off : dict of dict
        Rows of `points`, too: facets on curved shapes where the boundary slides, by how far they have come off these,
        see `OFF`.
    """

    points: Points
    cells: Cells
    inverted: Cells
    worst: Cells
    left_out: int
    off: Mapping[str, Cells] = field(default_factory=dict)

    @property
    def drawn(self) -> int:
        """How many inverted elements are drawn."""
        return number_of(self.inverted)

    @property
    def count(self) -> int:
        """How many elements are inverted."""
        return self.drawn + self.left_out


@dataclass(frozen=True, eq=False)
class Scene:
    """The picture of a mesh in all stages.

    Attributes
    ----------
    boundary : (k, d) float64
        Vertices of the boundary, which no stage moves.
    facets : dict of (f, 2, 3 or 4) int32
        Its facets, oriented, as rows of `boundary`, by their type.
    creases : (e, 2) int32
        Edges of a boundary in space at which it has a corner; none where it is coarse.
    coarse : bool
        The boundary has so many facets that it is drawn on a grid.
    states : dict
        By the name of the stage.
    """

    boundary: Points
    facets: Cells
    creases: Rows
    coarse: bool
    states: dict[str, State]

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.boundary.shape[1]

    @property
    def frame(self) -> tuple[Points, Points]:
        """The middle (d,) of the mesh and half its extent (d,), never 0, which is what pictures show at first."""
        points = self.boundary if len(self.boundary) else next(iter(self.states.values())).points
        low, high = points.min(axis=0), points.max(axis=0)
        half = (high - low) / 2
        return low + half, np.maximum(half, THINNEST * (half.max() or 1.0))


@dataclass(frozen=True, eq=False)
class Worst:
    """One of the worst elements of the result.

    Attributes
    ----------
    id : int
        The file's number.
    name : str
        What it is called, with that number.
    quality : float
        The smallest angle in degrees, or the scaled Jacobian where elements are not all simplices.
    measure : float
        Signed area or volume, in model units.
    inverted : bool
    centroid : (2,) or (3,) float64
        In the coordinates of the file.
    corners : (nodes, d) float64
        As in `State.points`.
    """

    id: int
    name: str
    quality: float
    measure: float
    inverted: bool
    centroid: Points
    corners: Points


@dataclass(frozen=True)
class Convergence:
    """The series of the paper's figure 4.4: inverted elements and smallest measures after so many sweeps.

    `smoothing` is the number of sweeps after which smoothing begins; None: there was none.
    """

    inverted: tuple[int, ...]
    measures: tuple[float, ...]
    smoothing: int | None


@dataclass(frozen=True, eq=False)
class Figures:
    """All that is drawn of a report.

    Attributes
    ----------
    histograms : dict
        Counts in the bins of `facts.binned`, of the first stage and of the last.
    convergence : Convergence or None
        None: there were no sweeps.
    worst : list of Worst
    scene : Scene
    """

    histograms: dict[str, tuple[int, ...]]
    convergence: Convergence | None
    worst: list[Worst]
    scene: Scene


def figures(report: Report, threads: int = 1) -> Figures:
    """Find out what is to be drawn of a report that has all stages."""
    stages = list(report.stages)
    inverted = {name: _inverted(report.meshes[name], summary) for name, summary in report.stages.items()}
    rows = worst_first(report.mesh, inverted[stages[-1]], WORST, threads)
    return Figures(
        histograms={stage: report.stages[stage].histogram for stage in dict.fromkeys((stages[0], stages[-1]))},
        convergence=convergence(report.records) if report.records else None,
        worst=_worst(report, rows, inverted[stages[-1]]),
        scene=scene(report.meshes, inverted, rows),
    )


def _inverted(mesh: Mesh, summary: Summary) -> Rows:
    """Return the rows that are inverted by shape or, for whoever reads the file, by their numbering."""
    return np.union1d(summary.inverted_elements, np.flatnonzero(mesh.topology.misnumbered)).astype(np.int32)


def convergence(records: Sequence[SweepRecord]) -> Convergence:
    """Return the series of the records."""
    smoothing = (i for i, record in enumerate(records) if record.phase.startswith(SMOOTHING))
    first = next(smoothing, None)
    return Convergence(
        inverted=tuple(record.inverted for record in records),
        measures=tuple(record.min_measure for record in records),
        smoothing=None if first is None else first - 1,
    )


def scene(meshes: Mapping[str, Mesh], inverted: Mapping[str, Rows], worst: NDArray[np.int64]) -> Scene:
    """Return the picture of the stages of a mesh; `inverted` and `worst` are rows of its elements."""
    result, mesh = list(meshes.items())[-1]
    curves = Curves(list(meshes.values()))
    boundary, facets, creases, coarse = _boundary(mesh, curves)
    whole = mesh.points.shape[1] == 2 and mesh.topology.m <= MOST_CELLS
    cells = curves.refined(_numbered(mesh, np.arange(mesh.topology.m)), shared=True) if whole else {}
    drawn = partial(_whole_state, curves, cells) if whole else partial(_partial_state, curves)
    return Scene(
        boundary=boundary,
        facets=facets,
        creases=creases,
        coarse=coarse,
        states={
            name: _with_off(drawn(mesh, inverted[name], worst if name == result else worst[:0]), mesh)
            for name, mesh in meshes.items()
        },
    )


def _worst(report: Report, rows: NDArray[np.int64], inverted_rows: Rows) -> list[Worst]:
    mesh, inverted = report.mesh, np.isin(rows, inverted_rows)
    judged = mesh.judged(mesh.topology.positions[rows])
    points = mesh.along_curve(mesh.points)
    _, measures, angles = judged.judge(points, 1)
    qualities = np.degrees(angles) if mesh.topology.simplicial else evaluate("scaled_jacobian", mesh)[rows]
    middles = centroids(report, rows)
    return [
        Worst(
            id=int(report.ids[row]),
            name=name,
            quality=float(qualities[i]),
            measure=float(measures[i]),
            inverted=bool(inverted[i]),
            centroid=middles[i],
            corners=points[judged.vertices(np.array([i])).ravel()],
        )
        for i, (row, name) in enumerate(zip(rows.tolist(), names(report, rows), strict=True))
    ]


def number_of(cells: Cells) -> int:
    """Return how many elements there are."""
    return sum(map(len, cells.values()))


def _numbered(mesh: Mesh, rows: NDArray[np.integer[Any]]) -> dict[str, Rows]:
    """Return some elements, by the vertices of the connectivity."""
    cells = {}
    for block in mesh.topology.blocks:
        at = np.searchsorted(block.rows, rows)
        at = at[block.rows.take(at, mode="clip") == rows]
        cells[block.element.key] = mesh.topology.number[block.vertices[at]]
    return cells


def _whole_state(curves: Curves, cells: Cells, mesh: Mesh, inverted: Rows, worst: NDArray[np.int64]) -> State:
    wrong, worst_ones = (curves.refined(_numbered(mesh, rows)) for rows in (inverted, worst))
    return State(curves.points(mesh), cells, wrong, worst_ones, left_out=0)


def _partial_state(curves: Curves, mesh: Mesh, inverted: Rows, worst: NDArray[np.int64]) -> State:
    # Spread, so that what is left out is left out everywhere.
    some = inverted[np.linspace(0, len(inverted) - 1, min(len(inverted), MOST_INVERTED)).astype(np.int64)]
    groups = [curves.refined(_numbered(mesh, rows)) for rows in (some, worst)]
    points, (wrong, worst_ones) = _compact(curves.points(mesh), groups)
    return State(points, {}, wrong, worst_ones, left_out=len(inverted) - len(some))


def _with_off(state: State, mesh: Mesh) -> State:
    """Return a state with the facets that have come off their shape; the farthest, where these are too many."""
    shapes = None if mesh.freedom is None else mesh.freedom.shapes
    if shapes is None:
        return state
    points = mesh.along_curve(mesh.points)
    shares = shapes.deviations(points) / (shapes.bound or 1.0)
    space = mesh.points.shape[1]
    rows = np.flatnonzero(shapes.directions[shapes.shape] == space - 1)
    rows = rows[np.argsort(-shares[rows], kind="stable")][:MOST_FACETS]
    classes = np.searchsorted([least for _, least in OFF], shares[rows]) - 1
    key = FACETS[space]
    groups = [{key: shapes.vertices[rows[classes == i]]} for i in range(len(OFF))]
    places, compact = _compact(points, groups)
    off = [{key: cells[key] + len(state.points) for key in cells} for cells in compact]
    names = (name for name, _ in OFF)
    return replace(state, points=np.concatenate([state.points, places]), off=dict(zip(names, off, strict=True)))


def _compact(points: Points, groups: Sequence[Cells]) -> tuple[Points, list[dict[str, Rows]]]:
    """Return the points that cells name, and the cells with the numbers that these have then."""
    named = [rows.ravel() for cells in groups for rows in cells.values()]
    used, numbers = np.unique(np.concatenate(named), return_inverse=True)
    parts = iter(np.split(numbers.reshape(-1).astype(np.int32), np.cumsum(list(map(len, named)))[:-1]))
    return points[used], [{key: next(parts).reshape(rows.shape) for key, rows in cells.items()} for cells in groups]


def _boundary(mesh: Mesh, curves: Curves) -> tuple[Points, dict[str, Rows], Rows, bool]:
    """Return the points (k, d), the oriented facets and the creases of the boundary, and whether that is coarse."""
    straight = mesh.along_curve(mesh.points)
    facets, none = _facets(mesh), np.empty((0, 2), dtype=np.int32)
    if number_of(facets) > MOST_FACETS:
        points, (facets,) = _compact(straight, [facets])
        return *_coarser(points, facets), none, True
    creases = none if straight.shape[1] == 2 else _creases(straight, facets)
    groups = [curves.refined(facets, shared=True), curves.refined({"line": creases})]
    points, (facets, lines) = _compact(curves.points(mesh), groups)
    return points, facets, lines["line"], False


def _facets(mesh: Mesh) -> dict[str, Rows]:
    """Return the oriented facets of the boundary, by the vertices of the connectivity; of a surface all elements."""
    topology, connectivity = mesh.topology, mesh.topology.connectivity
    facets: dict[str, Rows] = {}
    if mesh.surface is not None:
        facets = _numbered(mesh, np.arange(topology.m))
    elif isinstance(topology, MixedTopology):
        alone = topology.facets[connectivity.facet_mates < 0]
        size = (alone >= 0).sum(axis=1)
        for count in np.unique(size).tolist():
            facets[FACETS[count]] = alone[size == count, :count]
    else:
        parts = [
            connectivity.simplices[connectivity.mates[:, position] < 0][:, corners]
            for position, corners in enumerate(topology.element.shape.facets)
        ]
        facets[FACETS[mesh.dimension]] = np.concatenate(parts)
    return facets


def _coarser(points: Points, facets: Cells) -> tuple[Points, dict[str, Rows]]:
    """Join the vertices in each cell of a grid, as coarse as it takes for `MOST_FACETS`."""
    halves = np.concatenate([_triangles(rows) for rows in facets.values()])
    points, (merged,) = _compact(points, [{FACETS[halves.shape[1]]: _merged(points, halves)}])
    return points, merged


def _triangles(facets: Rows) -> Rows:
    """Return facets with those of four vertices cut in two."""
    return np.concatenate([facets[:, :3], facets[:, [0, 2, 3]]]) if facets.shape[1] == 4 else facets


def _merged(points: Points, facets: Rows) -> Rows:
    """Return facets (f, d) of which each vertex is the first in its cell of the finest grid that is coarse enough."""
    low, size, cells = points.min(axis=0), np.ptp(points, axis=0).max() or 1.0, GRID
    merged: NDArray[np.integer[Any]] = facets
    while len(merged) > MOST_FACETS:
        places = np.floor((points - low) / size * cells).astype(np.int64)
        _, first, numbers = np.unique(_keys(places, cells + 1), return_index=True, return_inverse=True)
        joined = numbers.reshape(-1)[facets]
        ordered = np.sort(joined, axis=1)
        _, once = np.unique(_keys(ordered, len(first)), return_index=True)
        merged = first[joined[once[(np.diff(ordered[once], axis=1) > 0).all(axis=1)]]]
        cells = cells * 2 // 3
    return merged.astype(np.int32)


def _keys(rows: NDArray[np.int64], base: int) -> NDArray[np.int64]:
    """Return one number (m,) for each row (m, c) of numbers below `base`, which is at most two million."""
    return rows @ base ** np.arange(rows.shape[1], dtype=np.int64)


def _creases(points: Points, facets: Cells) -> Rows:
    """Return the edges (e, 2) of facets at which two of them meet at an angle, or not two meet."""
    parts = [_edges_and_normals(points, rows) for rows in facets.values()]
    edges, normals = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.lexsort(edges.T)
    edges, normals = edges[order], normals[order]
    starts = np.flatnonzero(np.r_[True, (np.diff(edges, axis=0) != 0).any(axis=1)][: len(edges)])
    pairs = np.diff(np.r_[starts, len(edges)]) == 2
    first = starts[pairs]
    smooth = (normals[first] * normals[first + 1]).sum(axis=1) > np.cos(np.radians(CREASE))
    sharp = ~pairs
    sharp[np.flatnonzero(pairs)[~smooth]] = True
    return np.ascontiguousarray(edges[starts[sharp]])


def _edges_and_normals(points: Points, facets: Rows) -> tuple[Rows, Points]:
    """Return the edges (e, 2), ascending, of facets (f, 3 or 4), and for each the unit normal (e, 3) of its facet."""
    corners, size = points[facets], facets.shape[1]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])  # of a quadrilateral's diagonals
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0, lengths, 1)
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.sort(edges, axis=1), np.repeat(normals, size, axis=0)
