"""How good a mesh is, in a few numbers and element by element."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import Element
from meshfix_cli.mesh.judged import INSIDE, VALID
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.topology import Block, Topology, rows_of
from meshfix_cli.quality.formulas import evaluate, worst_and_mean
from meshfix_cli.quality.held import highest
from meshfix_cli.quality.relative import worst_and_mean_to

if TYPE_CHECKING:
    from meshfix_cli.mesh.quadratic import Judgement

Array = NDArray[np.float64]
BIN_WIDTH = 5.0  # degrees, of the histogram of smallest angles

# The smallest angle of a triangle is at most 60 degrees, of a tetrahedron at most acos(1/3) = 70.5.
BINS = {2: 12, 3: 15}
WITHIN = 1 + 1e-9  # times a bound, whatever is rounded
ROUNDED = 1e-9  # what is nearer to 1 is 1
JACOBIAN_BINS = 20  # of scaled Jacobians from 0 to 1, where elements are not all simplices


@dataclass(frozen=True)
class Jacobians:
    """Scaled Jacobians, the smallest of each element's corners, that of an ideal one 1.

    Attributes
    ----------
    smallest, mean, percentile_1 : float
        Over the elements.
    """

    smallest: float
    mean: float
    percentile_1: float


@dataclass(frozen=True)
class Curved:
    """Elements of second or higher order, where some are curved.

    Attributes
    ----------
    count, inverted, inside : int
        How many there are, how many are not valid, and how many of these are so only between their nodes.
    smallest : float
        The smallest Bezier coefficient of a Jacobian determinant, relative to that of the straight element.
    scaled_jacobian : float
        The smallest one at the nodes.
    """

    count: int
    inverted: int
    inside: int
    smallest: float
    scaled_jacobian: float


@dataclass(frozen=True)
class Kind:
    """The elements of one type.

    Attributes
    ----------
    element : Element
    count, inverted, inside : int
        How many there are, how many of them are not valid, and how many of these are so only inside, not at a corner.
    smallest, mean : float
        Of their scaled Jacobians.
    """

    element: Element
    count: int
    inverted: int
    inside: int
    smallest: float
    mean: float


@dataclass(frozen=True, eq=False)
class Summary:
    """Quality of a mesh; angles in degrees (dihedral for tetrahedra), measures in model units.

    Angles are those of the shape, without sign; `inverted` counts the elements that are not valid. Where there is a
    reference, `to_reference` are the smallest and the mean of `relative.mean_ratios`.

    Where elements are not all simplices, angles are those of triangles, quadrilaterals and tetrahedra, and NaN where
    there are none of these; `jacobians` tells of the scaled Jacobians of all elements, of which `histogram` is then,
    and `kinds` of the elements by their types.

    Where elements are curved, `inverted`, the smallest measure and scaled Jacobians are those of the curved elements,
    of which `curved` tells more, and all else that of the straight ones of their corners.
    """

    elements: int
    inverted: int
    folded: int
    min_measure: float
    min_angle: float
    max_angle: float
    mean_min_angle: float
    percentile_1: float
    histogram: tuple[int, ...]
    metrics: dict[str, tuple[float, float]]
    inverted_elements: NDArray[np.int32]
    to_reference: tuple[float, float] | None = None
    jacobians: Jacobians | None = None
    kinds: tuple[Kind, ...] = ()
    curved: Curved | None = None

    @property
    def smallest(self) -> float:
        """The smallest angle or, where elements are not all simplices, the smallest scaled Jacobian."""
        return self.min_angle if self.jacobians is None else self.jacobians.smallest


def summarise(mesh: Mesh, metrics: Sequence[str] = (), threads: int = 1, reference: Array | None = None) -> Summary:
    """Evaluate a mesh.

    Parameters
    ----------
    mesh : Mesh
    metrics : sequence of str
        Keys of `METRICS`; the summary holds the worst and the mean value of each, among the elements that have it.
    threads : int
    reference : (k, d) float64, optional
        Where the vertices, in the order of the connectivity, were before the boundary moved; not for surfaces.

    Returns
    -------
    Summary
        `folded` counts interior facets with both simplices on one side; `percentile_1` is that of the elements'
        smallest angles; `histogram` counts those in bins of `BIN_WIDTH` degrees.
    """
    if mesh.surface is not None:
        return _summarise_surface(mesh, metrics, threads)
    curved = None if mesh.quadratic is None else mesh.judge_curved(threads)
    judgement = None if curved is None else curved[2]
    if mesh.topology.simplicial:
        connectivity = mesh.topology.connectivity
        summary = _summarise_simplices(mesh.along_curve(mesh.points), connectivity, connectivity.rows, threads)
    else:
        summary = _summarise_elements(mesh, threads, judgement)
    summary = replace(
        summary,
        metrics={name: worst_and_mean(name, mesh, threads, judgement) for name in metrics},
        to_reference=None if reference is None else worst_and_mean_to(mesh, reference, threads),
    )
    return summary if curved is None else _with_curved(summary, *curved)


def _summarise_simplices(
    points: Array, connectivity: kernels.Connectivity, rows: NDArray[np.int32], threads: int
) -> Summary:
    """Evaluate simplices of one type, which have rows (m,), with the points (k, d) of a connectivity."""
    bins = BINS[points.shape[1]]
    smallest, histogram, total, inverted, folded, min_measure, largest = kernels.summarise(
        points, connectivity, bins, math.radians(BIN_WIDTH), threads
    )
    return Summary(
        elements=len(smallest),
        inverted=len(inverted),
        folded=folded,
        min_measure=min_measure,
        min_angle=math.degrees(smallest.min()),
        max_angle=math.degrees(largest),
        mean_min_angle=math.degrees(total / len(smallest)),
        percentile_1=math.degrees(_percentile(smallest, 1, histogram)),
        histogram=tuple(histogram.tolist()),
        metrics={},
        inverted_elements=np.sort(rows[inverted]),
    )


def _summarise_surface(mesh: Mesh, metrics: Sequence[str], threads: int) -> Summary:
    """Evaluate a surface: its elements one by one in their planes, and the edges at which one is turned over."""
    if mesh.topology.simplicial and not metrics:
        apart = mesh.judged().apart(mesh.along_curve(mesh.points), threads)
        summary = _summarise_simplices(*apart, mesh.topology.connectivity.rows, threads)
    else:
        summary = summarise(mesh.unfolded(threads), metrics, threads)
    wrong = np.zeros(mesh.topology.m, dtype=bool)
    wrong[summary.inverted_elements] = True
    one, other = wrong[mesh.topology.connectivity.rows[mesh.topology.joined]].T
    return replace(summary, folded=int((one != other).sum()))


def _with_curved(straight: Summary, wrong: NDArray[np.bool_], least: float, found: Judgement) -> Summary:
    """Return the summary of straight elements with the verdicts of the curved ones, see `Mesh.judge_curved`."""
    curved = Curved(
        count=len(found.verdicts),
        inverted=int((found.verdicts != VALID).sum()),
        inside=int((found.verdicts == INSIDE).sum()),
        smallest=float(found.smallest.min()),
        scaled_jacobian=float(found.scaled_jacobians.min()),
    )
    inverted = np.flatnonzero(wrong).astype(np.int32)
    return replace(straight, inverted=len(inverted), inverted_elements=inverted, min_measure=least, curved=curved)


def _summarise_elements(mesh: Mesh, threads: int, judgement: Judgement | None) -> Summary:
    """Evaluate a mesh of other elements than simplices of one type."""
    topology, points = mesh.topology, mesh.along_curve(mesh.points)
    verdicts, measures, _ = mesh.judged().judge(points, threads)
    jacobians = evaluate("scaled_jacobian", mesh, threads, judgement)
    angles = [_angles(block, mesh.points, threads) for block in topology.blocks]
    smallest, largest = (np.concatenate(part) for part in zip(*angles, strict=True))
    bins = np.clip((jacobians * JACOBIAN_BINS).astype(int), 0, JACOBIAN_BINS - 1)
    by_row = topology.of_rows(verdicts)
    if mesh.quadratic is not None and judgement is not None:
        by_row[mesh.quadratic.rows] = judgement.verdicts
    return Summary(
        elements=topology.m,
        inverted=int((verdicts != VALID).sum()),
        folded=_folded(topology, measures),
        min_measure=float(measures.min()),
        min_angle=math.degrees(smallest.min()) if len(smallest) else math.nan,
        max_angle=math.degrees(largest.max()) if len(largest) else math.nan,
        mean_min_angle=math.degrees(smallest.mean()) if len(smallest) else math.nan,
        percentile_1=math.degrees(np.percentile(smallest, 1)) if len(smallest) else math.nan,
        histogram=tuple(np.bincount(bins, minlength=JACOBIAN_BINS).tolist()),
        metrics={},
        inverted_elements=np.flatnonzero(by_row != VALID).astype(np.int32),
        jacobians=Jacobians(float(jacobians.min()), float(jacobians.mean()), float(np.percentile(jacobians, 1))),
        kinds=tuple(_kind(block, by_row[block.rows], jacobians[block.rows]) for block in topology.blocks),
    )


def _folded(topology: Topology, measures: Array) -> int:
    """Count the facets with both elements on one side; none where elements have nodes of their own."""
    here, there = topology.connectivity.facet_owners, topology.connectivity.facet_mates
    if len(there) == 0:
        return 0
    across = np.where(there >= 0, measures[here[there]], 0.0)
    return int(((measures[here] < 0) & (across > 0)).sum())


def _kind(block: Block, verdicts: NDArray[np.uint8], jacobians: Array) -> Kind:
    wrong, inside = int((verdicts != VALID).sum()), int((verdicts == INSIDE).sum())
    return Kind(block.element, len(block.rows), wrong, inside, float(jacobians.min()), float(jacobians.mean()))


def _angles(block: Block, points: Array, threads: int) -> tuple[Array, Array]:
    """Return the smallest and the largest angle of elements, in radians, of those types that have them: flat facets."""
    shape = block.element.shape
    if len(shape.simplices) == 1:
        return kernels.angles(points, block.vertices, threads)
    if shape.dimension == 3:
        return np.empty(0), np.empty(0)
    p = points[block.vertices[:, np.array(shape.simplices)]]
    a, b = p[:, :, 1] - p[:, :, 0], p[:, :, 2] - p[:, :, 0]
    angles = np.arctan2(np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]), (a * b).sum(axis=-1))
    return angles.min(axis=1), angles.max(axis=1)


def _percentile(angles: Array, percent: float, histogram: NDArray[np.int64]) -> float:
    """Return a percentile as numpy does, of the bins that it can be in."""
    rank = percent / 100 * (len(angles) - 1)
    here, behind = int(rank), min(int(rank) + 1, len(angles) - 1)
    bins = np.searchsorted(np.cumsum(histogram), behind, side="right") + 2  # one more, for rounding at its edge
    low = np.partition(angles[angles < math.radians(float(bins) * BIN_WIDTH)], (here, behind))
    return float(low[here] + (low[behind] - low[here]) * (rank - here))


def by_element(mesh: Mesh, threads: int = 1) -> dict[str, NDArray[np.generic]]:
    """Return arrays (m,): the signed measure in model units, the smallest angle in degrees, 1 where inverted.

    Where elements are not all simplices, the scaled Jacobian takes the place of the angle. Where some are curved, it is
    there as well, and so is the smallest coefficient of the Jacobian determinant, see `Curved`; NaN for others.
    """
    judged = mesh.judged().judge(mesh.along_curve(mesh.points), threads)
    verdicts, measure, quality = (mesh.topology.of_rows(values) for values in judged)
    curved: dict[str, NDArray[np.generic]] = {}
    found = None
    if mesh.quadratic is not None:
        found, rows = mesh.quadratic.judge(mesh.points, threads), mesh.quadratic.rows
        verdicts[rows], measure[rows] = found.verdicts, found.measures
        curved["smallest_coefficient"] = np.full(mesh.topology.m, np.nan)
        curved["smallest_coefficient"][rows] = found.smallest
    wrong = (verdicts != VALID) | mesh.topology.misnumbered
    simplicial = {"min_angle": np.degrees(quality)} if mesh.topology.simplicial else {}
    other = {}
    if found is not None or not mesh.topology.simplicial:
        other["scaled_jacobian"] = evaluate("scaled_jacobian", mesh, threads, found)
    return {"measure": measure, **simplicial, **other, **curved, "inverted": wrong.astype(np.int32)}


def worst_first(mesh: Mesh, inverted: NDArray[np.int32], count: int, threads: int = 1) -> NDArray[np.int64]:
    """Return the rows (at most count,) of the worst elements: inverted ones, then those of the smallest quality.

    Parameters
    ----------
    mesh : Mesh
    inverted : (k,) int32
        Rows of the inverted elements, as in `Summary.inverted_elements`.
    count, threads : int
    """
    if mesh.topology.simplicial:
        judged = mesh.judged()
        badness = -mesh.topology.of_rows(judged.angles(mesh.along_curve(mesh.points), threads))
    else:
        badness = -evaluate("scaled_jacobian", mesh, threads)
    if mesh.quadratic is not None:
        badness[mesh.quadratic.rows] = -np.minimum(mesh.quadratic.judge(mesh.points, threads).smallest, 1.0)
    badness[inverted] += 2 * math.pi
    return np.argsort(-badness, kind="stable")[:count]


def distances(before: Mesh, after: Mesh) -> Array:
    """Measure how far each vertex moved.

    Parameters
    ----------
    before, after : Mesh
        Of one topology.

    Returns
    -------
    (n,) float64
        In model units; 0 for points that belong to no element.
    """
    with np.errstate(invalid="ignore"):  # of points that are of no element
        first, *others = (along * along for along in (after.points - before.points).T)
        return np.where(before.used, np.sqrt(sum(others, first)), 0.0)


def displacement(before: Mesh, after: Mesh) -> dict[str, float]:
    """Summarise `distances`.

    Returns
    -------
    dict
        "mean", over the vertices that moved, and "largest", in model units; "vertices": how many moved.
    """
    far = distances(before, after)
    moved = far[far > 0]
    return {"mean": float(moved.mean()) if len(moved) else 0.0, "largest": float(far.max()), "vertices": len(moved)}


def slid(before: Mesh, result: Mesh, threads: int = 1) -> dict[str, Any]:
    """Return how many vertices of a mesh slide, and what that made of the shape; `before`: where that was found."""
    freedom = result.freedom
    assert freedom is not None
    moving = result.along_curve(result.movable)
    flat, curved = freedom.degrees[moving & ~freedom.curved], freedom.degrees[moving & freedom.curved]
    counts = {"lines": int((flat == 1).sum()), "planes": int((flat == 2).sum())}
    if freedom.shapes is None:
        return {"sliding": counts}
    counts.update(curves=int((curved == 1).sum()), surfaces=int((curved == 2).sum()))
    return {"sliding": counts, "shape": change_of_shape(before, result, threads)}


def change_of_shape(before: Mesh, after: Mesh, threads: int = 1) -> dict[str, float]:
    """Measure how a boundary that slides on curves and surfaces has changed.

    Parameters
    ----------
    before, after : Mesh
        The first where the reference of the freedom of the second was found.
    threads : int

    Returns
    -------
    dict
        "hausdorff", the distance between the two boundaries, see `Shapes.distances`, in model units; "deviation", that
        of the middles of edges and triangles from the shape, "bound", within which steps keep it, and "beyond", how
        many edges of curves and triangles are not within that; "folds" of the reference, see `Shapes`; and by which
        share "size", the volume or area, and "boundary", its area or length, have changed. Of a surface it is its own
        shape and area, and "size" is the volume that it encloses.
    """
    shapes = after.freedom.shapes if after.freedom is not None else None
    if shapes is None:
        return dict.fromkeys(("hausdorff", "deviation", "bound", "beyond", "folds", "size", "boundary"), 0)
    points, there = before.along_curve(before.points), after.along_curve(after.points)
    facets, encloses = after.topology.facets_between(None)[0], True
    if after.surface is not None:
        from meshfix_cli.mesh.sides import facets_of, is_closed

        facets, encloses = facets_of(after.topology), is_closed(after.topology)
    (size, boundary), (new_size, new_boundary) = (_sizes(one - points[0], facets) for one in (points, there))
    hausdorff, deviation = shapes.distances(there, threads)
    most = shapes.bound * WITHIN
    return {
        "hausdorff": hausdorff,
        "deviation": deviation,
        "bound": shapes.bound,
        "beyond": int((shapes.deviations(there, threads) > most).sum()) if deviation > most else 0,
        "folds": shapes.folds,
        **({"size": _change(size, new_size)} if encloses else {}),
        "boundary": _change(boundary, new_boundary),
    }


def _change(before: float, after: float) -> float:
    return after / before - 1 if before > 0 else 0.0


def _sizes(points: NDArray[np.float64], facets: NDArray[np.int32]) -> tuple[float, float]:
    """Return what facets (f, w) enclose, and how large they are themselves; those of four corners by both diagonals."""
    if points.shape[1] == 2:
        a, b = points[facets[:, 0]], points[facets[:, 1]]
        return abs(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())) / 2, float(np.linalg.norm(b - a, axis=1).sum())
    from meshfix_cli.mesh.patches import dots, lengths

    volume = area = 0.0
    triangles = [(facets, 1.0)]
    if facets.shape[1] == 4:
        whole = (facets >= 0).all(axis=1)
        triangles = [(facets[~whole, :3], 1.0)]
        triangles += [(facets[whole][:, cut], 0.5) for cut in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3))]
    for rows, share in triangles:
        offsets = np.arange(0, rows.size + 1, 3, dtype=np.int32)
        areas = kernels.area_vectors(points, offsets, np.ascontiguousarray(rows).ravel(), 1)
        volume += share * float(dots(areas, rows_of(points, np.ascontiguousarray(rows[:, 0]))).sum()) / 3
        area += share * float(lengths(areas).sum())
    return abs(volume), area


def _without_free_node(mesh: Mesh, rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """Leave out of some elements without a free corner those that have a free node on their edges, faces or inside."""
    if mesh.quadratic is None:
        return rows
    return np.setdiff1d(rows, mesh.quadratic.rows[mesh.quadratic.with_one(mesh.quadratic.free)])


def ceiling(mesh: Mesh, threads: int = 1) -> float | None:
    """Find what no method can raise: the smallest quality among the elements that have no free vertex.

    Of elements that are not simplices also what edges between held vertices allow at corners of others.

    Parameters
    ----------
    mesh : Mesh
    threads : int

    Returns
    -------
    float or None
        Degrees, dihedral for tetrahedra, or the scaled Jacobian where elements are not all simplices; None: nothing
        held is below the best that there is.
    """
    stuck = mesh.stuck(threads)
    if not mesh.topology.simplicial:
        rows = _without_free_node(mesh, mesh.topology.connectivity.rows[stuck])
        values = evaluate("scaled_jacobian", mesh, threads)[rows] if len(rows) else np.empty(0)
        least = min(values.min(initial=math.inf), math.inf if mesh.quadratic is not None else highest(mesh))
        return float(least) if len(rows) or least < 1 - ROUNDED else None
    if len(stuck) == 0:
        return None
    judged = mesh.judged(stuck)
    return math.degrees(float(judged.angles(mesh.along_curve(mesh.points), threads).min()))
