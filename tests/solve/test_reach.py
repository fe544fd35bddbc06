"""Tight bounds: a valid mesh found anywhere is drawn to where vertices may go."""

from __future__ import annotations

import math

import numpy as np
import pytest
from geometries import graded_axis, grid
from meshes import tangle
from numpy.typing import NDArray

from meshfix_cli import Mesh, untangle
from meshfix_cli.solve.foldover import Reach, drawn_into_reach


@pytest.fixture(scope="module")
def graded() -> Mesh:
    """A cube whose tetrahedra differ by 1e5 in volume."""
    axis = graded_axis(6, 50.0)
    return Mesh.build(*grid(axis, axis, axis))


def drawn(tangled: Mesh, bound: float, threads: int = 1) -> list[Mesh]:
    """What is yielded, in the order of the mesh."""
    start, free = tangled.along_curve(tangled.points), tangled.along_curve(tangled.movable)
    reached = drawn_into_reach(tangled.topology.stars(), free, Reach(start, bound), threads)
    return [tangled.with_vertices(points) for points in reached]


def farthest(one: Mesh, other: Mesh) -> float:
    return float(np.linalg.norm(one.points - other.points, axis=1).max())


@pytest.mark.parametrize("seed", range(3))
def test_a_mesh_on_the_rim_of_all_balls_is_reached(graded: Mesh, seed: int) -> None:
    """The vertices are valid where they came from; wherever they may go, they go farther."""
    tangled = tangle(graded, 100, 2, seed)
    bound = 1.0001 * farthest(tangled, graded)
    assert farthest(tangled, untangle(tangled, "FF", smooth=0).after) > bound
    (reached,) = drawn(tangled, bound)
    assert not reached.check()[0]
    assert farthest(tangled, reached) <= bound
    assert (reached.points[~graded.movable] == graded.points[~graded.movable]).all()


def test_what_is_drawn_has_the_same_bits_for_any_number_of_threads(graded: Mesh) -> None:
    tangled = tangle(graded, 100, 2)
    results = [drawn(tangled, farthest(tangled, graded), threads) for threads in (1, 2, 3)]
    assert len({one.points.tobytes() for (one,) in results}) == 1


def test_nothing_is_yielded_outside_of_the_bound(graded: Mesh) -> None:
    """Also where no valid mesh is in reach."""
    tangled = tangle(graded, 100, 2)
    for bound in (0.5, 1e-3, 1e-9):
        for one in drawn(tangled, bound * graded.mean_edge_length()):
            assert farthest(tangled, one) <= bound * graded.mean_edge_length()
            assert one.check()[0]
    assert not drawn(tangled, math.inf)
    assert not drawn(tangled, 0.0)


@pytest.mark.parametrize(("axis", "share", "seed"), [(graded_axis(4, 50.0), 0.97, 4), (np.linspace(0, 1, 7), 0.85, 0)])
def test_what_drawing_reaches_is_not_missed(axis: NDArray[np.float64], share: float, seed: int) -> None:
    """The first is solved by that alone; the second is not, but left with fewer inverted elements."""
    mesh = Mesh.build(*grid(axis, axis, axis))
    tangled = tangle(mesh, 100, 4, seed)
    bound = share * farthest(tangled, mesh)
    (reached,) = drawn(tangled, bound)
    outcomes = [untangle(tangled, max_move=bound, threads=threads) for threads in (1, 2, 3)]
    for outcome in outcomes:
        assert outcome.records[-1].inverted <= reached.check()[0] < tangled.check()[0]
        assert farthest(tangled, outcome.after) <= bound
    assert outcomes[0].valid or share < 0.9
    assert len({outcome.after.points.tobytes() for outcome in outcomes}) == 1
