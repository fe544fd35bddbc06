"""Layers along a wall that moved and left them behind, without a reference."""

from __future__ import annotations

import numpy as np
import pytest
from geometries import annulus, layers
from layered import COUNTS, FIRST, body_of, heights, layered, left_behind, turn
from meshes import tangle

from meshfix_cli import Mesh, untangle
from meshfix_cli.solve.layers import before_the_motion

FOLLOWING = "layers following the wall"


def moved_by(mesh: Mesh, length: float) -> Mesh:
    """Along the first axis."""
    return left_behind(mesh, body_of(mesh) + length * np.eye(mesh.dimension)[0])


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("length", [0.003, 0.01, 0.02])
def test_layers_follow_a_wall_and_what_is_far_from_it_stays(d: int, length: float) -> None:
    """In front of the body as behind it, where its motion has stretched the first layer and inverted nothing."""
    mesh = layered(d)
    moved = moved_by(mesh, length)
    assert moved.check()[0] > 0
    before = heights(moved, 1)
    assert max(before.max() / FIRST, FIRST / before.min()) > 3
    outcome = untangle(moved)
    assert outcome.valid
    assert outcome.records[1].phase == FOLLOWING
    after = heights(outcome.after, 1)
    assert FIRST / 2 < after.min() <= after.max() < 2 * FIRST
    way = np.linalg.norm(outcome.after.points - moved.points, axis=1)
    assert (way > 0.1 * length).mean() < 0.42
    assert not way[12 * COUNTS[d] :].any()
    assert not way[: COUNTS[d]].any()


def test_layers_follow_a_wall_that_turned() -> None:
    mesh = layered()
    outcome = untangle(left_behind(mesh, body_of(mesh) @ turn(3).T))
    assert outcome.valid
    assert heights(outcome.after, 1) == pytest.approx(FIRST, rel=0.5)
    assert outcome.after.points[17 * COUNTS[2] :].tobytes() == mesh.points[17 * COUNTS[2] :].tobytes()


def test_the_wall_was_where_the_layers_would_go_on() -> None:
    """But for their growth and the curvature: within half a layer; a wall that has not moved is where it was."""
    mesh = layered()
    moved, stars = moved_by(mesh, 0.01), mesh.topology.stars()
    free = mesh.along_curve(mesh.movable)
    found = before_the_motion(stars, moved.along_curve(moved.points), free)
    assert found is not None
    assert np.linalg.norm(mesh.with_vertices(found).points - mesh.points, axis=1).max() < 0.5 * FIRST
    outside = mesh.with_vertices(found).points[-COUNTS[2] :]
    assert outside.tobytes() == mesh.points[-COUNTS[2] :].tobytes()


def test_any_number_of_threads_gives_the_same_bits() -> None:
    moved = moved_by(layered(), 0.01)
    results = [untangle(moved, threads=threads).after.points.tobytes() for threads in (1, 2, 3)]
    assert len(set(results)) == 1


def test_without_smoothing_they_follow_alone() -> None:
    outcome = untangle(moved_by(layered(), 0.01), smooth=0)
    assert outcome.valid
    assert [record.phase for record in outcome.records] == ["input", FOLLOWING]


def test_no_vertex_goes_farther_than_it_may() -> None:
    moved = moved_by(layered(), 0.01)
    outcome = untangle(moved, max_move=0.0102)
    assert outcome.valid
    assert outcome.records[1].phase == FOLLOWING
    assert np.linalg.norm(outcome.after.points - moved.points, axis=1).max() <= 0.0102


def test_other_tangles_are_not_taken_for_layers_left_behind() -> None:
    """A body among regular elements, and thin layers whose inner vertices are tangled."""
    disc, thin, ringed = Mesh.build(*annulus()), Mesh.build(*layers()), layered()
    hole = ~disc.movable & (np.linalg.norm(disc.points, axis=1) < 0.5)
    turned = disc.with_points(np.where(hole[:, None], disc.points @ turn(30).T, disc.points))
    for mesh in (turned, tangle(thin, 5, 1), tangle(thin, 100, 1), tangle(ringed, 1, 0.1), tangle(ringed, 25, 1)):
        assert mesh.check()[0] > 0
        assert FOLLOWING not in {record.phase for record in untangle(mesh).records}
