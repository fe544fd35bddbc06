"""Surfaces in space: from which side each element is seen, and where the vertices may slide.

Each vertex moves in its tangent plane and from there back to the surface, within its patch: patches end at features, at
the boundary, at lines, and where more than two elements meet.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.freedom import Freedom, flat_of, freedom_of
from meshfix_cli.mesh.patches import Constraints, unit_vectors
from meshfix_cli.mesh.sides import (
    Kept,
    Surface,
    around,
    facets_of,
    frames_of,
    normals_seen,
    rows_of_elements,
)
from meshfix_cli.mesh.topology import read_only

if TYPE_CHECKING:
    from meshfix_cli.mesh.curved import Smooth
    from meshfix_cli.mesh.mesh import Mesh

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]
LONG = 20  # vertices of features that go on in each other: no tangle feigns so many
ASTRAY = 0.5  # mean edge lengths from a reference: where most vertices are farther away, it tells nothing of a surface


def seen(mesh: Mesh, threads: int = 1) -> Mesh:
    """Return a surface as it is seen where its vertices are now, see `normals_seen`; nobody has told what it keeps."""
    points = mesh.along_curve(mesh.points)
    return replace(mesh, surface=Surface(read_only(normals_seen(mesh.topology, points, threads))))


def laid_out(
    mesh: Mesh, kept: Kept, reference: Array | None = None, threads: int = 1, region: Mask | None = None
) -> Mesh:
    """Return a surface whose vertices slide on it, within their patches.

    Parameters
    ----------
    mesh : Mesh
    kept : Kept
    reference : (k, 3) float64, optional
        Where the vertices, in the order of the connectivity, were before they moved: it gives the normals, the patches
        and the shape, unless most of them are far from it. Default: where they are.
    threads : int
    region : (k,) bool, optional
        Where a tangle was, whose traces are no features.
    """
    surface, topology = mesh.surface, mesh.topology
    assert surface is not None
    now = mesh.along_curve(mesh.points)
    points = now if reference is None else reference
    normals = surface.normals if reference is None else normals_seen(topology, points, threads)
    facets = facets_of(topology)
    inverted, broken = np.zeros(topology.m, dtype=bool), np.zeros(len(points), dtype=bool)
    judged = replace(mesh, surface=Surface(normals)).judged()
    inverted[judged.check(points, threads)[0]] = True
    broken[judged.vertices(inverted)] = True
    given = Constraints(facets, kept.labels, kept.lines, inverted, broken, normals)
    flat = flat_of(points, given)
    freedom = freedom_of(points, given, kept.smooth, flat, with_shapes=region is None or reference is not None)
    if reference is not None and _is_elsewhere(freedom, now, ASTRAY * mesh.mean_edge_length(threads), threads):
        return laid_out(mesh, kept, None, threads, region)
    if region is not None:
        found = replace(mesh, freedom=freedom, surface=Surface(normals, kept))
        traces = np.asarray(np.append(feigned(found, region), False)[facets].any(axis=1))
        smoothed = np.where(traces[:, None], _seen_around(mesh, threads)[1], normals) if traces.any() else normals
        freedom = freedom_of(points, replace(given, normals=smoothed), kept.smooth, flat)
    degrees = freedom.degrees
    moves = degrees == 2
    if kept.slide != "none":
        moves |= (degrees == 1) & (~freedom.curved if kept.slide == "flat" else True)
    movable = read_only(topology.of_vertices(moves & ~kept.held))
    return replace(
        mesh, freedom=freedom, movable=movable, surface=Surface(read_only(normals), kept, reference is not None)
    )


def laid_by_default(mesh: Mesh, smooth: Smooth, reference: Array | None = None, threads: int = 1) -> Mesh:
    """Return a surface whose vertices slide on it, but for features, where nobody has told yet what these are.

    See `laid_out`; what is held is what does not move.
    """
    surface, topology = mesh.surface, mesh.topology
    assert surface is not None
    if surface.kept is not None and reference is None:
        return mesh
    held = mesh.along_curve(~mesh.movable & ~topology.boundary)
    lines = np.empty((0, 2), dtype=np.int32)
    kept = surface.kept or Kept(np.zeros(topology.m, dtype=np.int64), lines, held, smooth, "none")
    return laid_out(mesh, kept, reference, threads)


def _is_elsewhere(freedom: Freedom, points: Array, far: float, threads: int) -> bool:
    """Whether most of the points (k, 3) that slide on curves and surfaces are far from these."""
    half = int(freedom.curved.sum()) // 2
    if freedom.shapes is None or int(kernels.off_reference(freedom.kernel, points, far, threads).sum()) <= half:
        return False
    return int((freedom.rounded(points, threads)[1] > far).sum()) > half


def inward(mesh: Mesh) -> Mask:
    """Mark the elements (m,) of closed parts of a surface that are seen from inside, as most of them are numbered."""
    topology = mesh.topology
    found = np.zeros(topology.m, dtype=bool)
    connectivity, points = topology.connectivity, mesh.along_curve(mesh.points)
    if not connectivity.orientable:
        return found
    part, (here, there) = connectivity.component, topology.across()
    areas = kernels.area_vectors(points, *rows_of_elements(topology), 1)
    middles = topology.centroids(points - points[0], np.arange(topology.m))
    volumes = np.bincount(part, (areas * middles).sum(axis=1))
    is_open = np.bincount(part[here], there < 0) > 0
    found[connectivity.rows] = ((volumes < 0) & ~is_open)[part]
    return found


def in_planes(mesh: Mesh, region: Mask, edges: Mask, threads: int = 1) -> Mesh:
    """Return a surface whose vertices move in planes, their own or those that what is around them tells; see `seen`.

    Parameters
    ----------
    mesh : Mesh
        As `laid_out` gives it.
    region : (k,) bool
        Where a tangle is or was: vertices there, in the order of the connectivity, may seem to be on features.
    edges : (k,) bool
        Those that are on features beyond doubt: planes do not lean over these.
    threads : int
    """
    topology, points = mesh.topology, mesh.along_curve(mesh.points)
    assert mesh.surface is not None and mesh.surface.kept is not None
    of_vertices, of_elements = _seen_around(mesh, threads, edges)
    axes = frames_of(of_vertices)
    assert mesh.freedom is not None
    flat = (mesh.freedom.degrees == 2) & ~mesh.freedom.curved
    axes[flat] = mesh.freedom.axes[mesh.freedom.frame[flat]]
    free = (slides(mesh) | feigned(mesh, region)) & (of_vertices != 0).any(axis=1)
    k = len(points)
    frame = np.where(free, np.arange(k), -1).astype(np.int32)
    none = np.zeros(k + 1, dtype=np.int32), np.empty(0, dtype=np.int32)
    freedom = Freedom(frame, np.full(k, 2, dtype=np.uint8), np.ascontiguousarray(axes), *none)
    normals = np.where((of_elements != 0).any(axis=1, keepdims=True), of_elements, mesh.surface.normals)
    surface = replace(mesh.surface, normals=read_only(normals))
    return replace(mesh, freedom=freedom, movable=read_only(topology.of_vertices(free)), surface=surface)


def normals_of_vertices(mesh: Mesh, threads: int = 1) -> Array:
    """Return unit normals (k, 3) that what is around the vertices of the connectivity tells; 0: nothing does."""
    return _seen_around(mesh, threads)[0]


def _seen_around(mesh: Mesh, threads: int, edges: Mask | None = None) -> tuple[Array, Array]:
    """Return the unit normals that vertices (k, 3) and elements (m, 3) have by what is around them, see `around`."""
    areas = kernels.area_vectors(mesh.along_curve(mesh.points), *rows_of_elements(mesh.topology), threads)
    of_vertices, of_elements = around(mesh.topology, areas, edges)
    return unit_vectors(of_vertices), unit_vectors(of_elements)


def tangled(mesh: Mesh, threads: int = 1) -> Mask:
    """Mark the vertices (k,) of inverted elements, in the order of the connectivity, and a ring around them."""
    points, judged = mesh.along_curve(mesh.points), mesh.judged()
    broken = np.zeros(len(points), dtype=bool)
    broken[judged.vertices(judged.check(points, threads)[0])] = True
    return mesh.topology.stars(threads).grown(broken, 1).view(bool)


def slides(mesh: Mesh) -> Mask:
    """Mark the vertices (k,) inside of the patches of a surface that are not held."""
    assert mesh.surface is not None and mesh.surface.kept is not None and mesh.freedom is not None
    return np.asarray((mesh.freedom.degrees == 2) & ~mesh.surface.kept.held)


def feigned(mesh: Mesh, region: Mask) -> Mask:
    """Mark the vertices (k,) of a region that only a tangle around them seems to put on features.

    Others are on features that go on, or where such meet.
    """
    if not meets_features(mesh, region):
        return np.zeros(len(region), dtype=bool)
    assert mesh.freedom is not None
    degrees = mesh.freedom.degrees
    along, k = (degrees == 1) & ~mesh.along_curve(mesh.topology.boundary), len(region)
    start, end = mesh.topology.edges()
    beside = np.bincount(start, along[end], k) + np.bincount(end, along[start], k)
    lone = np.where(along, beside == 0, (degrees == 0) & (beside < 2))
    return np.asarray(region & lone & ~ends(mesh))


def meets_features(mesh: Mesh, region: Mask) -> bool:
    """Whether a vertex (k,) of a region is on a feature, neither at the boundary nor held."""
    assert mesh.freedom is not None
    return bool((region & (mesh.freedom.degrees < 2) & ~ends(mesh)).any())


def ends(mesh: Mesh) -> Mask:
    """Mark the vertices (k,) that are at the boundary, or held."""
    assert mesh.surface is not None and mesh.surface.kept is not None
    return np.asarray(mesh.surface.kept.held | mesh.along_curve(mesh.topology.boundary))


def on_edges(mesh: Mesh, region: Mask) -> Mask:
    """Mark the vertices (k,) on features and boundaries that go on for long, as those that a tangle feigns do not."""
    assert mesh.freedom is not None
    found = np.asarray((mesh.freedom.degrees < 2) & ~feigned(mesh, region))
    ends = np.stack(mesh.topology.edges(), axis=1)
    chain = kernels.joined(np.ascontiguousarray(ends[found[ends].all(axis=1)]), len(found))
    return np.asarray(found & (np.bincount(chain, found, len(found))[chain] >= LONG))
