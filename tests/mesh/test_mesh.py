"""Building a mesh: what is refused, how it is oriented, what is fixed."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from typing import Any

import generate
import numpy as np
import pytest
from elements import MESHES
from meshes import tangle

from meshfix_cli import kernels, untangle
from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.mesh import Mesh, mask_of
from meshfix_cli.quality.summary import summarise

SQUARE: list[list[float]] = [[0, 0], [1, 0], [1, 1], [0, 1], [0.4, 0.6]]
FAN = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]


@pytest.mark.parametrize(
    ("points", "simplices", "words"),
    [
        (SQUARE, np.empty((0, 3), dtype=int), "no elements"),
        (SQUARE, [[0, 1, 9]], "refers to vertices"),
        (SQUARE, [[0, 1, -1]], "refers to vertices"),
        (SQUARE, [[0, 1, 1]], "names a vertex twice"),
        (SQUARE, [[0, 1, 2, 3]], "shape"),
        (SQUARE, [[0.0, 1.0, 2.0]], "integers"),
        ([[0.0, 0, 0, 0]], [[0, 1, 2]], "shape"),
        ([[0, 0], [1, 0], [np.nan, 1]], [[0, 1, 2]], "vertex 2 .* not finite"),
        ([[0, 0], [np.inf, 0], [0, 1]], [[0, 1, 2]], "vertex 1 .* not finite"),
        ([[0, 0], [1e200, 0], [0, 1]], [[0, 1, 2]], "cannot be computed with"),
        ([[5.0, 5], [5, 5], [5, 5]], [[0, 1, 2]], "in one point"),
        (
            [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 2]],
            [[0, 1, 2], [0, 1, 3], [1, 0, 4]],
            "more than two triangles share",
        ),
    ],
)
def test_refused_with_a_clear_sentence(points: object, simplices: object, words: str) -> None:
    with pytest.raises(InvalidMeshError, match=words):
        Mesh.build(points, simplices)  # type: ignore[arg-type]


def test_moebius_band_is_refused() -> None:
    n = 8
    triangles = []
    for i in range(n):
        a, b = 2 * i, 2 * i + 1
        c, d = (2 * i + 2, 2 * i + 3) if i < n - 1 else (1, 0)
        triangles += [[a, b, c], [b, d, c]]
    points = np.random.default_rng(0).uniform(size=(2 * n, 2))
    with pytest.raises(InvalidMeshError, match="Moebius"):
        Mesh.build(points, triangles)


def test_nan_in_a_point_that_no_element_uses_is_no_matter() -> None:
    mesh = Mesh.build([*SQUARE, [np.nan, 0]], FAN)
    assert mesh.topology.used.tolist() == [True] * 5 + [False]
    assert mesh.movable.tolist() == [False] * 4 + [True, False]
    assert untangle(mesh).valid


def test_mirrored_mesh_is_solved_in_its_own_orientation(mesh: Mesh) -> None:
    """Turning the numbering, or the geometry, turns nothing else: the same points come out."""
    tangled = Mesh.build(tangle(mesh).points, mesh.topology.simplices)
    simplices = tangled.topology.simplices[:, [1, 0, *range(2, mesh.dimension + 1)]]
    mirrored = Mesh.build(tangled.points, simplices)
    assert mirrored.topology.flipped.all()
    assert mirrored.topology.mirrored.all()
    assert not mirrored.topology.misnumbered.any()
    assert not mirrored.topology.misnumbered.any()
    np.testing.assert_array_equal(mirrored.topology.simplices, tangled.topology.simplices)
    assert untangle(mirrored).after.points.tobytes() == untangle(tangled).after.points.tobytes()
    reflected = Mesh.build(tangled.points * ([-1] + [1] * (mesh.dimension - 1)), tangled.topology.simplices)
    assert reflected.check()[0] == tangled.check()[0]


def test_elements_numbered_against_their_neighbours_are_told_apart(mesh: Mesh) -> None:
    simplices = mesh.topology.simplices.copy()
    odd = [3, 50, 51, 200]
    simplices[odd] = simplices[odd][:, [1, 0, *range(2, mesh.dimension + 1)]]
    mixed = Mesh.build(mesh.points, simplices)
    assert np.flatnonzero(mixed.topology.misnumbered).tolist() == odd
    assert mixed.check()[0] == 0
    assert not untangle(mixed).valid  # a solver that reads the file finds negative elements
    assert summarise(mixed).folded == 0


def test_swapping_vertices_does_not_hide_a_tangle(plate: Mesh) -> None:
    """A mesh made 'positive' by renumbering its inverted elements still overlaps itself, and is found out."""
    tangled = tangle(plate)
    simplices = tangled.topology.simplices.copy()
    bad = summarise(tangled).inverted_elements
    simplices[bad] = simplices[bad][:, [1, 0, 2]]
    hidden = Mesh.build(tangled.points, simplices)
    assert hidden.check()[0] == len(bad)
    outcome = untangle(hidden)
    assert outcome.records[-1].inverted == 0
    assert not outcome.valid  # the numbering is still that of the file


def test_components_of_either_orientation() -> None:
    mesh = Mesh.build(
        [*SQUARE, *(np.array(SQUARE) + 5).tolist()],
        [*FAN, *[[b + 5, a + 5, c + 5] for a, b, c in FAN]],
    )
    assert mesh.check()[0] == 0
    assert len(np.unique(mesh.topology.component)) == 2
    assert np.flatnonzero(mesh.topology.mirrored).tolist() == [4, 5, 6, 7]
    assert not mesh.topology.misnumbered.any()


def test_a_part_without_an_inner_vertex_is_judged_with_the_others() -> None:
    """Each triangle has points of its own: the one turned over is tangled, for all that its part could tell."""
    points = np.concatenate([np.array(SQUARE)[corners] for corners in FAN])
    cells = np.arange(len(points)).reshape(-1, 3)
    cells[2] = cells[2, ::-1]
    mesh = Mesh.build(points, cells)
    assert np.flatnonzero(mesh.topology.misnumbered).tolist() == [2]


def test_a_star_too_large_to_number_is_refused() -> None:
    turn = np.linspace(0, 2 * np.pi, 70001)[:-1]
    points = np.concatenate([[[0.0, 0.0]], np.column_stack([np.cos(turn), np.sin(turn)])])
    around = np.arange(1, 70001)
    mesh = Mesh.build(points, np.column_stack([0 * around, around, np.roll(around, -1)]))
    assert mesh.check()[0] == 0
    with pytest.raises(InvalidMeshError, match="65,535 neighbours"):
        untangle(mesh)


def test_points_of_another_shape_are_refused(plate: Mesh) -> None:
    for points in (plate.points[:5], plate.points.astype("f4"), np.zeros((plate.topology.n, 3))):
        with pytest.raises(ValueError, match="points have the shape"):
            plate.with_points(points)


def test_repeated_simplices_count_once() -> None:
    mesh = Mesh.build(SQUARE, [*FAN, [2, 4, 1]])
    assert mesh.topology.source.tolist() == [0, 1, 2, 3]
    assert mesh.movable.tolist() == [False] * 4 + [True]


def test_coincident_points_are_never_merged() -> None:
    """Two squares that touch along a slit of doubled points: the slit is boundary on both sides."""
    left = np.array(SQUARE)
    right = left + np.array([1, 0])
    mesh = Mesh.build(np.concatenate([left, right]), [*FAN, *(np.array(FAN) + 5).tolist()])
    assert np.flatnonzero(mesh.movable).tolist() == [4, 9]


def test_components_that_touch_in_a_vertex_work() -> None:
    points: list[list[float]] = [*SQUARE, [2, 1], [2, 2], [1, 2], [1.2, 1.9]]
    mesh = Mesh.build(points, [*FAN, [2, 5, 8], [5, 6, 8], [6, 7, 8], [7, 2, 8]])
    assert np.flatnonzero(mesh.movable).tolist() == [4, 8]
    assert untangle(mesh).valid


def test_interface_between_regions_is_the_facets_between_labels(bracket: Mesh) -> None:
    labels = (bracket.points[bracket.topology.simplices].mean(axis=1)[:, 1] > 1.0).astype(int)
    held = bracket.topology.interface(labels)
    groups = [set(bracket.topology.simplices[labels == k].ravel().tolist()) for k in (0, 1)]
    inside = ~bracket.topology.boundary
    assert set(np.flatnonzero(held & inside)) == {v for v in groups[0] & groups[1] if inside[v]}
    assert not bracket.with_fixed(held).movable[held].any()
    assert not bracket.topology.interface(np.zeros_like(labels)).any()


def test_a_mesh_is_a_value(plate: Mesh) -> None:
    with pytest.raises(ValueError, match="read-only"):
        plate.points[0, 0] = 1.0
    moved = plate.with_points(plate.points + 1.0)
    assert moved.topology is plate.topology


def test_a_mesh_survives_pickling_with_its_order(mesh: Mesh) -> None:
    """And so the same bits come out in another process."""
    tangled = tangle(mesh)
    for copy in (pickle.loads(pickle.dumps(tangled)), deepcopy(tangled)):
        assert copy.points.tobytes() == tangled.points.tobytes()
        np.testing.assert_array_equal(copy.topology.simplices, tangled.topology.simplices)
        assert untangle(copy).after.points.tobytes() == untangle(tangled).after.points.tobytes()


@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_elements_survive_pickling_before_and_after_their_stars_are_built(name: str) -> None:
    mesh = Mesh.build(*MESHES[name]())
    before = pickle.loads(pickle.dumps(mesh))
    mesh.topology.stars()
    kept = [key for key in dir(mesh.topology.connectivity) if isinstance(getattr(kernels.Connectivity, key), property)]
    assert {"codes", "nodes", "facet_mates", "owners", "faces"} <= set(kept)
    tangled = tangle(mesh)
    expected = untangle(tangled).after.points.tobytes()
    for copy in (before, pickle.loads(pickle.dumps(mesh)), deepcopy(mesh)):
        assert type(copy.topology) is type(mesh.topology)
        stars = copy.topology.stars()
        for key in kept:
            if key != "mates":  # of simplices
                np.testing.assert_array_equal(getattr(stars, key), getattr(mesh.topology.connectivity, key))
        assert untangle(copy.with_points(tangled.points)).after.points.tobytes() == expected


def test_one_mesh_may_be_used_by_several_threads() -> None:
    """Its stars are built by the first that needs them."""
    for seed in range(5):
        mesh = Mesh.build(*generate.bracket(0.09, 10))
        tangled = tangle(Mesh.build(mesh.points, mesh.topology.simplices), 10, 1, seed)
        fresh = Mesh.build(tangled.points, mesh.topology.simplices)
        with ThreadPoolExecutor(4) as pool:
            outcomes = list(pool.map(lambda _: untangle(fresh, threads=2), range(4)))  # noqa: B023
        assert len({outcome.after.points.tobytes() for outcome in outcomes}) == 1


def test_mean_edge_length_is_that_of_the_distinct_edges() -> None:
    mesh = Mesh.build(SQUARE[:4], [[0, 1, 2], [0, 2, 3]])
    assert mesh.mean_edge_length() == pytest.approx((4 + np.sqrt(2)) / 5)


def test_repetitions_are_found_in_all_blocks_of_a_type() -> None:
    points = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1]], dtype=float)
    quad, triangles = [[0, 1, 4, 5]], [[1, 2, 3], [1, 3, 4]]
    mesh = Mesh.build(
        points, [("quad", quad), ("triangle", triangles), ("quad", [[4, 5, 0, 1]]), ("triangle", triangles)]
    )
    assert mesh.topology.source.tolist() == [0, 1, 2]
    assert [block.vertices.tolist() for block in mesh.topology.blocks] == [triangles, quad]


def test_vertices_are_fixed_by_a_mask_or_by_their_indices(bracket: Mesh) -> None:
    cells, n = bracket.topology.simplices, len(bracket.points)
    free = np.flatnonzero(bracket.movable)
    mask = np.isin(np.arange(n), free[:9])
    for fixed in (mask, mask.tolist(), free[:9], free[:9].tolist(), [*free[:9], free[0]]):
        np.testing.assert_array_equal(Mesh.build(bracket.points, cells, fixed).movable, bracket.movable & ~mask)
    for nothing in (np.array([]), np.zeros(n, dtype=bool), None):
        np.testing.assert_array_equal(Mesh.build(bracket.points, cells, nothing).movable, bracket.movable)


def test_a_mask_may_be_changed_once_it_is_given() -> None:
    mask = np.array([True, False])
    held = mask_of(mask, 2)
    mask[:] = False
    assert held.tolist() == [True, False]


@pytest.mark.parametrize(("fixed", "words"), [
    (lambda n: [n], "names vertex 1863, and there are those from 0 to 1862"),
    (lambda n: [0, -1], "names vertex -1"),
    (lambda n: np.ones(n - 1, dtype=bool), r"shape \(1862,\) and type bool, and neither a mask \(1863,\) of bool"),
    (lambda n: np.ones(n, dtype=np.uint8), "a 0 or a 1 for each vertex: as a mask it is to be of bool"),
    (lambda n: np.zeros((2, 2), dtype=int), r"shape \(2, 2\) and type int64"),
    (lambda n: [0.5], "nor indices of vertices"),
])  # fmt: skip
def test_what_does_not_tell_vertices_is_one_sentence(bracket: Mesh, fixed: Callable[[int], Any], words: str) -> None:
    with pytest.raises(InvalidMeshError, match=words) as caught:
        Mesh.build(bracket.points, bracket.topology.simplices, fixed(len(bracket.points)))
    assert "\n" not in str(caught.value)
