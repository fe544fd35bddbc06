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
from meshfix_cli.mesh.patches import Constraints
from meshfix_cli.mesh.sides import (
    Kept,
    Surface,
    facets_of,
    frames_of,
    normals_around,
    normals_seen,
    rows_of_elements,
)
from meshfix_cli.mesh.tangle import Tangle
from meshfix_cli.mesh.topology import read_only

if TYPE_CHECKING:
    from meshfix_cli.mesh.curved import Smooth
    from meshfix_cli.mesh.mesh import Mesh

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]
ASTRAY = 0.5  # mean edge lengths from a reference: where most vertices are farther away, it tells nothing of a surface


def seen(mesh: Mesh, threads: int = 1) -> Mesh:
    """Return a surface as it is seen where its vertices are now, see `normals_seen`; nobody has told what it keeps."""
    points = mesh.along_curve(mesh.points)
    return replace(mesh, surface=Surface(read_only(normals_seen(mesh.topology, points, threads))))


def laid_out(
    mesh: Mesh,
    kept: Kept,
    reference: Array | None = None,
    threads: int = 1,
    tangle: Tangle | None = None,
    with_shape: bool = True,
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
    tangle : Tangle, optional
        That was there: its traces are no features.
    with_shape : bool
        False: of one that is tangled, and nothing else is known of, it is only told who might slide, and nobody does.
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
    plain = None if tangle is None else tangle.plain
    given = Constraints(facets, kept.labels, kept.lines, inverted, broken, normals, plain)
    has_shape = with_shape or reference is not None or tangle is not None or not inverted.any()
    freedom = freedom_of(points, given, kept.smooth, flat_of(points, given), has_shape)
    if reference is not None and _is_elsewhere(freedom, now, ASTRAY * mesh.mean_edge_length(threads), threads):
        return laid_out(mesh, kept, None, threads, tangle, with_shape)
    degrees = freedom.degrees
    moves = degrees == 2 if tangle is None else (degrees == 2) & ~tangle.features
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


def in_planes(mesh: Mesh, tangle: Tangle, threads: int = 1) -> Mesh:
    """Return a surface whose vertices move in planes, their own or those that what is around them tells; see `seen`.

    Parameters
    ----------
    mesh : Mesh
        As `laid_out` gives it.
    tangle : Tangle
        That is or was there: planes do not lean over the features that are none of its.
    threads : int
    """
    topology, points = mesh.topology, mesh.along_curve(mesh.points)
    assert mesh.surface is not None and mesh.surface.kept is not None
    of_vertices, of_elements = normals_around(topology, points, threads, tangle.features)
    axes = frames_of(of_vertices)
    assert mesh.freedom is not None
    flat = (mesh.freedom.degrees == 2) & ~mesh.freedom.curved
    axes[flat] = mesh.freedom.axes[mesh.freedom.frame[flat]]
    free = (slides(mesh) | tangle.plain) & (of_vertices != 0).any(axis=1)
    k = len(points)
    frame = np.where(free, np.arange(k), -1).astype(np.int32)
    none = np.zeros(k + 1, dtype=np.int32), np.empty(0, dtype=np.int32)
    freedom = Freedom(frame, np.full(k, 2, dtype=np.uint8), np.ascontiguousarray(axes), *none)
    normals = np.where((of_elements != 0).any(axis=1, keepdims=True), of_elements, mesh.surface.normals)
    surface = replace(mesh.surface, normals=read_only(normals))
    return replace(mesh, freedom=freedom, movable=read_only(topology.of_vertices(free)), surface=surface)


def slides(mesh: Mesh) -> Mask:
    """Mark the vertices (k,) inside of the patches of a surface that are not held."""
    assert mesh.surface is not None and mesh.surface.kept is not None and mesh.freedom is not None
    return np.asarray((mesh.freedom.degrees == 2) & ~mesh.surface.kept.held)
