"""Tangled meshes and stars."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.curved import Smooth
from meshfix_cli.mesh.freedom import constraints_of, freedom_of
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve.perturb import perturb
from meshfix_cli.solve.strategies import Move


def tangle(mesh: Mesh, percent: float = 25, distance: float = 2, seed: int = 0) -> Mesh:
    """The paper's protocol; the distance in mean edge lengths."""
    return perturb(mesh, percent, distance * mesh.mean_edge_length(), seed)[0]


def sliding(mesh: Mesh, regions: NDArray[np.int64] | None = None) -> Mesh:
    """Let all of the flat boundary slide."""
    points = mesh.along_curve(mesh.points)
    freedom = freedom_of(points, constraints_of(mesh.topology, points, regions))
    return mesh.sliding(freedom, np.zeros(len(mesh.points), dtype=bool))


def sliding_on_curves(mesh: Mesh, bound: float = 0.03, feature_angle: float = 40.0) -> Mesh:
    """Let all of the boundary slide that is smooth; the bound in mean edge lengths."""
    points = mesh.along_curve(mesh.points)
    smooth = Smooth(feature_angle, bound * mesh.mean_edge_length())
    freedom = freedom_of(points, constraints_of(mesh.topology, points), smooth)
    return mesh.sliding(freedom, np.zeros(len(mesh.points), dtype=bool))


def star_rows(mesh: Mesh, vertex: int) -> tuple[NDArray[np.int32], NDArray[np.uint16], NDArray[np.int32]]:
    """Neighbours (k,), faces (n, d) as positions among them, and simplices (n,) of a vertex."""
    stars, d = mesh.topology.stars(), mesh.dimension
    here = int(np.flatnonzero(stars.vertices == vertex)[0])
    first, last = stars.offsets[here], stars.offsets[here + 1]
    row = stars.neighbours[stars.neighbour_offsets[here] : stars.neighbour_offsets[here + 1]]
    faces = np.ascontiguousarray(stars.faces.reshape(-1, d)[first:last])
    return stars.vertices[row], faces, stars.rows[stars.corners[first:last] // (d + 1)]


def star_of(mesh: Mesh, vertex: int) -> tuple[NDArray[np.float64], NDArray[np.uint16]]:
    """Neighbours (k, d) around the origin and faces (n, d) of a vertex, as the kernels take them."""
    row, faces, _ = star_rows(mesh, vertex)
    points = mesh.points[row] - mesh.points[row].mean(axis=0)
    return points / np.abs(points).max(), faces


def random_star(
    random: np.random.Generator, d: int, spread: float = 0.3
) -> tuple[NDArray[np.float64], NDArray[np.uint16]]:
    """A closed star: the hull of points on a sphere, then moved; with a large spread it is tangled."""
    from scipy.spatial import ConvexHull

    directions = random.standard_normal((int(random.integers(d + 2, 16)), d))
    points = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    inward = np.linalg.det(points[faces]) < 0
    faces[inward] = faces[inward][:, [1, 0, *range(2, d)]]
    moved = points * random.uniform(1 - spread, 1 + spread, (len(points), 1))
    moved += spread * random.standard_normal(points.shape)
    return np.ascontiguousarray(moved / np.abs(moved).max()), faces.astype(np.uint16)


def relocate(
    mesh: Mesh, move: Move, points: NDArray[np.float64], blocks: NDArray[np.int32],
    only: NDArray[np.bool_] | None = None, threshold_sine2: float = 1.0, max_move: float = math.inf, threads: int = 1,
) -> None:  # fmt: skip
    """Relocate, in place, the free vertices, or `only` these (n,), of some blocks; they came from those of the mesh."""
    stars, local = mesh.topology.stars(), mesh.along_curve(points)
    states = mesh.along_curve(mesh.movable if only is None else only).astype(np.uint8) * kernels.DUE
    floor = 1e-9 if move is Move.COME_BACK else -math.inf
    kernels.relocate(
        move, local, states, stars, blocks, threshold_sine2, floor, mesh.along_curve(mesh.points), max_move, threads
    )
    points[stars.vertices] = local


def with_an_inverted_fixed_simplex(mesh: Mesh) -> Mesh:
    """Reflect a vertex of a simplex that has no free vertex at the centre of the face opposite."""
    simplices = mesh.topology.simplices
    first, *others = simplices[~mesh.movable[simplices].any(axis=1)][0]
    points = mesh.points.copy()
    points[first] = 2 * points[others].mean(axis=0) - points[first]
    return mesh.with_points(points)


def with_a_rough_boundary(mesh: Mesh, most: float, seed: int) -> Mesh:
    """Move each vertex of the boundary by up to so much of a mean edge length along each axis."""
    points, held = mesh.points.copy(), ~mesh.movable
    by = most * mesh.mean_edge_length()
    points[held] += np.random.default_rng(seed).uniform(-by, by, (held.sum(), mesh.dimension))
    return mesh.with_points(points)


def built_for(name: str) -> Any:
    """Another build of the kernels; skips where this processor, or the compiler, has not what it takes."""
    module = pytest.importorskip(f"meshfix_cli.kernels.{name}")
    return module if name == "_any" or module.has_avx2() else pytest.skip("there is no AVX2 here")
