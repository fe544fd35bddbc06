"""Surfaces: smoothed on themselves, and untangled along a reference or by what their points tell."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import surface_bodies
from surface_measures import folds
from surfaces import Array, Rows, box, bumps, height, laid, off_torus, spoiled, tangled, torus

from meshfix_cli.mesh.curved import Smooth
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.surface import laid_by_default
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.quality.summary import change_of_shape, summarise
from meshfix_cli.solve import strategies
from meshfix_cli.solve.untangle import untangle

BODIES: dict[str, Callable[[], tuple[Array, Rows]]] = {
    "torus": torus, "quads": lambda: torus(quads=True), "bumps": bumps, "box": box,
}  # fmt: skip


def test_smoothing_keeps_to_the_surface_and_raises_the_angles() -> None:
    points, rows = torus(jitter=0.3)
    mesh = laid(points, rows)
    levels: tuple[tuple[strategies.Smooth, float], ...] = (("auto", 20), ("best", 22))
    for smooth, least in levels:
        outcome = untangle(mesh, smooth=smooth)
        before, after = summarise(mesh), summarise(outcome.after)
        assert outcome.valid and after.min_angle > max(least, before.min_angle)
        assert after.mean_min_angle > before.mean_min_angle
        shape = change_of_shape(mesh, outcome.after)
        assert shape["deviation"] <= shape["bound"] * 1.001 and abs(shape["size"]) < 0.01
        # Phong's surface is nearer to the torus than the triangles are: the sag of a chord is h^2 / 8r.
        h = mesh.mean_edge_length()
        assert off_torus(outcome.after.points).max() < 0.25 * h**2 / (8 * 0.8)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("body", BODIES)
def test_what_is_tangled_along_a_surface_is_untangled_with_a_reference(body: str, seed: int) -> None:
    points, rows = BODIES[body]()
    mesh = laid(tangled(points, rows, seed), rows, reference=points)
    assert mesh.check()[0] > len(rows) / 20
    outcome = untangle(mesh)
    assert outcome.valid and summarise(outcome.after).folded == 0
    fixed = ~mesh.movable
    np.testing.assert_array_equal(outcome.after.points[fixed], mesh.points[fixed])
    if body == "box":
        on_sides = ((points == 0) | (points == 6)).any(axis=1)
        kept = (points == 0) | (points == 6)
        assert on_sides.all() and (outcome.after.points[kept] == points[kept]).all()


@pytest.mark.parametrize("options", [{"smooth": 0}, {"only_invalid": True}])
def test_what_is_not_smoothed_goes_back_to_the_surface_all_the_same(options: dict[str, Any]) -> None:
    points, rows = torus()
    outcome = untangle(Mesh.build(tangled(points, rows), rows), **options)
    assert outcome.valid and outcome.records[-1].inverted == 0
    assert off_torus(outcome.after.points).max() < 0.1 * outcome.before.mean_edge_length()


@pytest.mark.parametrize("seed", range(120))
def test_a_small_surface_gets_no_worse(seed: int) -> None:
    """Nor as it is seen afterwards, by itself: vertices coincide, lie on others' edges, or have left."""
    points, rows = spoiled(np.random.default_rng(seed))
    mesh = Mesh.build(points, rows)
    outcome = untangle(mesh)
    here, there = (summarise(Mesh.build(one.points, rows)) for one in (mesh, outcome.after))
    assert here.inverted == outcome.records[0].inverted and there.inverted == outcome.records[-1].inverted
    assert (there.inverted, there.inverted and there.folded) <= (here.inverted, here.folded)
    if there.inverted == here.inverted:
        assert there.min_angle >= here.min_angle - 1e-6
    if here.inverted == 0:
        assert outcome.valid


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("body", ["ellipsoid", "torus", "bumps", "cylinder", "part"])
def test_without_a_reference_a_tangle_leaves_no_fold_and_edges_where_they_are(body: str, seed: int) -> None:
    whole = surface_bodies.BODIES[body]()
    folded = surface_bodies.tangled(whole, 25, 1.5, seed + 4)
    assert folds(whole, folded.points) > 500
    outcome = untangle(Mesh.build(folded.points, folded.cells))
    after = outcome.after.points
    assert outcome.valid and folds(whole, after) == 0
    held = whole.of_points == surface_bodies.HELD
    np.testing.assert_array_equal(after[held], folded.points[held])


@pytest.mark.parametrize("body", ["torus", "bumps"])
def test_without_a_reference_the_points_tell_the_surface(body: str) -> None:
    points, rows = BODIES[body]()
    folded = tangled(points, rows)
    outcome = untangle(Mesh.build(folded, rows))
    after = outcome.after.points
    far = off_torus(after) if body == "torus" else np.abs(after[:, 2] - height(*after[:, :2].T))
    # All vertices were on the surface; the triangles of their own are as far away.
    h = outcome.after.mean_edge_length()
    assert outcome.records[0].inverted > 50 and outcome.valid and far.max() < 0.1 * h
    assert summarise(outcome.after).folded == 0


def test_what_needs_no_smoothing_goes_back_to_the_surface_all_the_same() -> None:
    points, cells = surface_bodies.icosphere(2)
    rows = cells.astype(np.int32)
    random, h = np.random.default_rng(1), laid(points, rows).mean_edge_length()
    some = random.choice(len(points), len(points) // 20, replace=False)
    points[some] += h * random.normal(size=(len(some), 3))
    outcome = untangle(Mesh.build(points / np.linalg.norm(points, axis=1, keepdims=True), rows))
    assert outcome.records[0].inverted > 0 and outcome.valid
    off = np.abs(np.linalg.norm(outcome.after.points, axis=1) - 1)
    assert off.max() < h**2 / 8  # the sag of a chord


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("body", BODIES)
def test_what_is_mended_was_not_called_impossible(body: str, seed: int) -> None:
    """A tangle seems to put vertices on features, which do not move; it is gone with them."""
    points, rows = BODIES[body]()
    mesh = laid(tangled(points, rows, seed), rows)
    assert untangle(mesh).valid
    assert not find_obstacles(mesh)


def test_what_is_held_is_called_impossible() -> None:
    points, rows = torus()
    folded = tangled(points, rows)
    mesh = laid_by_default(Mesh.build(folded, rows, fixed=np.arange(len(points))), Smooth(40.0, 0.1))
    assert find_obstacles(mesh).inverted.tolist() == summarise(mesh).inverted_elements.tolist() != []


@pytest.mark.parametrize("seed", range(3))
def test_rims_stay_where_a_tangle_beside_them_is_taken_for_its_own_reference(seed: int) -> None:
    body = surface_bodies.cylinder(0.1)
    folded = surface_bodies.tangled(body, 25, 1.5, seed)
    assert folds(body, folded.points) > 500
    outcome = untangle(Mesh.build(folded.points, folded.cells))
    rim = np.unique(body.rims)
    np.testing.assert_array_equal(outcome.after.points[rim], folded.points[rim])
    assert outcome.valid and folds(body, outcome.after.points) == 0


def test_threads_give_the_same_bits() -> None:
    points, rows = torus(72, 40)
    one, other = (untangle(laid(points, rows), smooth="best", threads=threads).after.points for threads in (1, 3))
    assert one.tobytes() == other.tobytes() and one.tobytes() != points.tobytes()


def test_a_surface_far_away_and_small_is_solved_as_well() -> None:
    points, rows = torus(24, 12)
    straight = untangle(laid(points, rows), smooth=10).after.points
    moved = untangle(laid(1e-3 * points + [7.0, -3.0, 5.0], rows), smooth=10).after.points
    np.testing.assert_allclose((moved - [7.0, -3.0, 5.0]) * 1e3, straight, atol=1e-6)


def test_max_move_holds() -> None:
    points, rows = torus(jitter=0.4)
    mesh = laid(points, rows)
    reach = 0.1 * mesh.mean_edge_length()
    outcome = untangle(mesh, max_move=reach)
    far = np.linalg.norm(outcome.after.points - points, axis=1)
    assert 0 < far.max() <= reach
