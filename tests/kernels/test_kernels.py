"""Kernels against definitions: sines and gradients, the minimum-norm point, facets, stars, blocks and colours."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict

import generate
import numpy as np
import pytest
from meshes import built_for, random_star, relocate, star_of, star_rows, tangle
from numpy.typing import NDArray
from scipy.optimize import nnls

from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.simplices import mean_ratio, min_sine
from meshfix_cli.quality.summary import summarise
from meshfix_cli.solve.strategies import Move


@pytest.mark.parametrize("d", [2, 3])
def test_gradients_of_the_sines_by_finite_differences(random: np.random.Generator, d: int) -> None:
    for _ in range(50):
        points, faces = random_star(random, d, spread=0.1)
        x = random.uniform(-0.05, 0.05, d)
        values, gradients, _ = kernels.sines(points, faces, x)
        step = 1e-6
        for k, unit in enumerate(np.eye(d)):
            plus, minus = (kernels.sines(points, faces, x + s * step * unit)[0] for s in (1, -1))
            np.testing.assert_allclose(gradients[:, k], (plus - minus) / (2 * step), rtol=1e-5, atol=1e-6)
        assert len(values) == len(faces) * (3 if d == 2 else 6)


def test_sines_are_those_of_the_metric(mesh: Mesh) -> None:
    expected = evaluate("min_sine", mesh)
    for vertex in np.flatnonzero(mesh.movable)[::7]:
        row, _, star = star_rows(mesh, vertex)
        points, faces = star_of(mesh, vertex)
        around = mesh.points[row]
        centre = around.mean(axis=0)
        x = (mesh.points[vertex] - centre) / np.abs(around - centre).max()
        values, _, smallest2 = kernels.sines(points, faces, np.ascontiguousarray(x))
        per_simplex = values.reshape(len(faces), -1).min(axis=1)
        np.testing.assert_allclose(per_simplex, expected[star], rtol=1e-9)
        assert np.sqrt(smallest2) == pytest.approx(per_simplex.min(), rel=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_mean_ratio_is_the_metrics_and_its_derivatives_are_right(random: np.random.Generator, d: int) -> None:
    regular = 2 * math.sqrt(3) if d == 2 else 6 * 2 ** (1 / 3)
    checked = 0
    for _ in range(100):
        points, faces = random_star(random, d, spread=0.1)
        x = random.uniform(-0.05, 0.05, d)
        value, again, gradient, hessian = kernels.mean_ratio(points, faces, x)
        if kernels.sines(points, faces, x)[2] < 0.01:
            continue
        star = points[faces]
        edges = star - x
        metric = mean_ratio(edges, np.linalg.det(edges) / math.factorial(d))
        expected = ((regular / metric) ** d).sum()
        assert value == pytest.approx(expected, rel=1e-12)
        assert again == pytest.approx(expected, rel=1e-12)
        step = 1e-5
        for k, unit in enumerate(np.eye(d)):
            plus, minus = (kernels.mean_ratio(points, faces, x + s * step * unit) for s in (1, -1))
            size = np.abs(hessian).max()
            assert gradient[k] == pytest.approx((plus[0] - minus[0]) / (2 * step), rel=1e-5, abs=1e-6 * size)
            np.testing.assert_allclose(hessian[k], (plus[2] - minus[2]) / (2 * step), rtol=1e-5, atol=1e-6 * size)
        checked += 1
    assert checked > 20


def test_mean_ratio_is_infinite_where_a_simplex_is_inverted(random: np.random.Generator) -> None:
    points, faces = random_star(random, 3, spread=0.1)
    assert kernels.mean_ratio(points, faces, 3 * points[faces[0]].mean(axis=0))[1] == math.inf


@pytest.mark.parametrize("d", [2, 3])
def test_min_norm_point_is_optimal_and_in_the_hull(random: np.random.Generator, d: int) -> None:
    for trial in range(500):
        vectors = random.standard_normal((int(random.integers(1, 12)), d)) + random.uniform(0, 2)
        if trial % 5 == 0:
            vectors = np.concatenate([vectors, vectors])  # repeated
        if trial % 7 == 0:
            vectors[:, -1] = 1.0  # in a plane
        p = kernels.min_norm_point(vectors)
        assert (vectors @ p).min() >= p @ p - 1e-9  # no vector points further back: the optimality condition
        weights, residual = nnls(np.vstack([vectors.T, np.ones(len(vectors))]), np.append(p, 1.0))
        assert residual < 1e-9
        assert weights.min() >= 0


def test_theorem_3_2_level_sets_of_the_minimum_sine_are_convex(random: np.random.Generator) -> None:
    checked = 0
    for _ in range(300):
        points, faces = random_star(random, 2, spread=0.15)
        candidates = random.uniform(-0.6, 0.6, (20, 2))
        sine2 = [kernels.sines(points, faces, x)[2] for x in candidates]
        feasible = [(q, x) for q, x in zip(sine2, candidates, strict=True) if q > 0]
        for (qa, a), (qb, b) in itertools.combinations(feasible, 2):
            middle = kernels.sines(points, faces, (a + b) / 2)[2]
            assert middle >= min(qa, qb) * (1 - 1e-12)
            checked += 1
    assert checked > 1000


def test_facets_boundary_and_stars_by_definition(mesh: Mesh) -> None:
    topology, d = mesh.topology, mesh.dimension
    facets = defaultdict(list)
    for s, simplex in enumerate(topology.simplices.tolist()):
        for k in range(d + 1):
            facets[tuple(sorted(simplex[:k] + simplex[k + 1 :]))].append(s * (d + 1) + k)
    own = topology.connectivity  # corners of its own, by the rows of the mesh
    across = np.where(own.mates < 0, -1, own.rows[own.mates // (d + 1)] * (d + 1) + own.mates % (d + 1))
    mates = topology.of_rows(across).ravel()
    for corners in facets.values():
        if len(corners) == 1:
            assert mates[corners[0]] == -1
        else:
            a, b = corners
            assert (mates[a], mates[b]) == (b, a)
    boundary = {v for facet, corners in facets.items() if len(corners) == 1 for v in facet}
    assert boundary == set(np.flatnonzero(topology.boundary).tolist())

    for vertex in range(0, topology.n, 11):
        row, faces, incident = star_rows(mesh, vertex)
        assert set(incident.tolist()) == set(np.flatnonzero((topology.simplices == vertex).any(axis=1)).tolist())
        assert set(row.tolist()) == set(topology.simplices[incident].ravel().tolist()) - {vertex}
        measure = np.linalg.det(mesh.points[row][faces] - mesh.points[vertex])
        expected = kernels.measure(mesh.points, topology.simplices, 1)[0][incident] * (2 if d == 2 else 6)
        np.testing.assert_allclose(measure, expected, rtol=1e-9)


def test_blocks_partition_and_colours_separate(fine: Mesh) -> None:
    topology, stars = fine.topology, fine.topology.stars()
    assert sorted(stars.vertices.tolist()) == np.flatnonzero(topology.used).tolist()
    block_of = np.arange(len(stars.vertices)) // kernels.BLOCK_SIZE
    colour_of = np.empty(block_of[-1] + 1, dtype=int)
    for colour, blocks in enumerate(topology.colours):
        colour_of[blocks] = colour
    assert sorted(stars.colour_blocks.tolist()) == list(range(block_of[-1] + 1))
    start = np.repeat(np.arange(len(stars.vertices)), np.diff(stars.neighbour_offsets))
    across = block_of[start] != block_of[stars.neighbours]
    assert (colour_of[block_of[start[across]]] != colour_of[block_of[stars.neighbours[across]]]).all()
    assert len(topology.colours) > 2


@pytest.mark.parametrize("d", [2, 3])
def test_blocks_are_near_in_space_whatever_the_order_of_the_file(d: int, plate: Mesh, fine: Mesh) -> None:
    mesh = fine if d == 3 else Mesh.build(*generate.plate(0.03))
    random = np.random.default_rng(1)
    new = random.permutation(mesh.topology.n)
    points = np.empty_like(mesh.points)
    points[new] = mesh.points
    shuffled = Mesh.build(points, new[random.permutation(mesh.topology.simplices)])
    stars = shuffled.topology.stars()
    assert sorted(stars.vertices.tolist()) == list(range(mesh.topology.n))
    assert sorted(stars.rows.tolist()) == list(range(len(mesh.topology.simplices)))
    np.testing.assert_array_equal(stars.vertices[stars.simplices], shuffled.topology.simplices[stars.rows])
    block_of = np.arange(len(stars.vertices)) // kernels.BLOCK_SIZE
    start = np.repeat(block_of, np.diff(stars.neighbour_offsets))
    inside = (start == block_of[stars.neighbours]).mean()
    assert inside > (0.9 if d == 2 else 0.6)
    assert summarise(shuffled).mean_min_angle == pytest.approx(summarise(mesh).mean_min_angle)


SMOOTHING_MOVES = (
    Move.SMART_LAPLACIAN, Move.COMBINED_SMOOTH, Move.RAISE_SMALLEST, Move.MEAN_RATIO
)  # fmt: skip


EVERYWHERE = [move for move in Move if move is not Move.DRAW_BACK]  # which is for curved boundaries alone


def relocated(mesh: Mesh, move: Move, threads: int, rotate: int, begin: Mesh | None = None) -> bytes:
    points = (begin or mesh).points.copy()
    for blocks in mesh.topology.colours:
        rolled = np.roll(blocks, rotate)
        relocate(mesh, move, points, rolled, threshold_sine2=0.07, threads=threads)
    return points.tobytes()


@pytest.mark.parametrize("move", EVERYWHERE)
def test_same_bits_for_any_threads_and_any_assignment_of_blocks(fine: Mesh, move: Move) -> None:
    smoothing = move in (
        Move.SMART_LAPLACIAN,
        Move.COMBINED_SMOOTH,
        Move.MEAN_RATIO,
        Move.RAISE_SMALLEST,
    )
    start = tangle(fine, 5, 0.3) if smoothing else tangle(fine)
    begin = fine if move is Move.COME_BACK else start
    expected = relocated(start, move, 1, 0, begin)
    assert expected != begin.points.tobytes()
    for threads, rotate in ((1, 1), (2, 0), (2, 2), (3, 0), (3, 1)):
        assert relocated(start, move, threads, rotate, begin) == expected


@pytest.mark.parametrize("move", list(Move))
@pytest.mark.parametrize("case", ["usual", "hard", "collapsed"])
def test_builds_for_wider_vectors_give_the_same_bits(mesh: Mesh, move: Move, case: str) -> None:
    start = {"usual": tangle(mesh, 5, 0.3), "hard": tangle(mesh, 100, 8), "collapsed": collapsed(mesh)}[case]
    simplices, movable, results = start.topology.simplices, np.ascontiguousarray(start.movable), []
    for build in (built_for("_any"), built_for("_avx2")):
        used = build.used_vertices(simplices, start.topology.n)
        own = build.Connectivity(start.points, simplices, used, 1)
        own.build_stars(1)
        points = start.points[own.vertices]
        reference, states = points.copy(), movable[own.vertices].astype(np.uint8) * build.DUE
        for blocks in np.split(own.colour_blocks, own.colour_offsets[1:-1]):
            build.relocate(move, points, states, own, blocks, 0.07, -math.inf, reference, math.inf, 1)
        summary = build.summarise(points, own, 12, 0.1, 1)
        results.append((points.tobytes(), *(np.asarray(value).tobytes() for value in summary)))
    assert results[0] == results[1]


@pytest.mark.parametrize("move", list(Move))
def test_vertices_that_are_not_due_would_not_move(fine: Mesh, move: Move) -> None:
    """A sweep over what is due gives the same bits as one over everything."""
    start = tangle(fine, 5, 0.3) if move in SMOOTHING_MOVES else tangle(fine, 2, 1)
    stars, reference = fine.topology.stars(), fine.along_curve(start.points)
    everything = fine.along_curve(fine.movable).astype(np.uint8) * kernels.DUE
    one, two, states, skipped = reference.copy(), reference.copy(), everything.copy(), 0
    for _ in range(5):
        for blocks in fine.topology.colours:
            all_of_them = kernels.relocate(
                move, one, everything.copy(), stars, blocks, 0.07, -math.inf, reference, math.inf, 2
            )
            some = kernels.relocate(move, two, states, stars, blocks, 0.07, -math.inf, reference, math.inf, 2)
            assert all_of_them[1] == some[1]
            skipped += all_of_them[0] - some[0]
        assert one.tobytes() == two.tobytes()
    assert skipped > 0 or move not in (Move.SMART_LAPLACIAN, Move.COMBINED_SMOOTH, Move.RAISE_SMALLEST)


def collapsed(mesh: Mesh) -> Mesh:
    points = mesh.points.copy()
    points[mesh.movable] = points[mesh.movable].mean(axis=0)
    return mesh.with_points(points)


def test_only_movable_vertices_move(mesh: Mesh) -> None:
    start = tangle(mesh)
    for move in Move:
        points = start.points.copy()
        for blocks in mesh.topology.colours:
            relocate(mesh, move, points, blocks)
        assert points[~mesh.movable].tobytes() == start.points[~mesh.movable].tobytes()


def test_laplacian_moves_to_the_mean_of_the_neighbours(plate: Mesh) -> None:
    vertex = int(np.flatnonzero(plate.movable)[0])
    only = plate.movable & (np.arange(plate.topology.n) == vertex)
    points = plate.points.copy()
    for blocks in plate.topology.colours:
        relocate(plate, Move.LAPLACIAN, points, blocks, only)
    row, _, _ = star_rows(plate, vertex)
    np.testing.assert_allclose(points[vertex], plate.points[row].mean(axis=0), rtol=1e-14)


@pytest.mark.parametrize("move", [Move.SMART_LAPLACIAN, Move.COMBINED_SMOOTH, Move.RAISE_SMALLEST])
def test_smoothing_never_lowers_the_worst_of_a_star(mesh: Mesh, move: Move) -> None:
    """Star by star, on a mesh with invalid stars, which must be left alone."""
    points = tangle(mesh, 20, 0.6).points.copy()
    improved = 0
    for vertex in np.flatnonzero(mesh.movable)[:400]:
        star = mesh.topology.simplices[star_rows(mesh, vertex)[2]]
        before, old = worst_sine(points, star), points[vertex].copy()
        only = mesh.movable & (np.arange(mesh.topology.n) == vertex)
        for blocks in mesh.topology.colours:
            relocate(mesh, move, points, blocks, only)
        after = worst_sine(points, star)
        assert after >= before * (1 - 1e-12) if before > 0 else (points[vertex] == old).all()
        improved += after > before
    assert improved > 20


@pytest.mark.parametrize("floor", [0.0, 0.15])
def test_the_mean_ratio_gets_better_above_the_floor(mesh: Mesh, floor: float) -> None:
    """Star by star: neither below the floor nor, where it was below, lower than it was."""
    points, simplices = tangle(mesh, 20, 0.3).points.copy(), mesh.topology.simplices
    improved = lowered = 0
    for vertex in np.flatnonzero(mesh.movable)[:400]:
        star = simplices[star_rows(mesh, vertex)[2]]
        before, ratio, old = worst_sine(points, star), inverse_ratio(points, star), points[vertex].copy()
        only = mesh.movable & (np.arange(mesh.topology.n) == vertex)
        for blocks in mesh.topology.colours:
            relocate(mesh, Move.MEAN_RATIO, points, blocks, only, threshold_sine2=floor**2)
        after = worst_sine(points, star)
        if before <= 0 or (points[vertex] == old).all():
            assert (points[vertex] == old).all()
            continue
        assert after >= min(before, floor) * (1 - 1e-11)
        assert inverse_ratio(points, star) < ratio
        improved, lowered = improved + 1, lowered + (after < before)
    assert improved > 50
    assert lowered > 0


def inverse_ratio(points: NDArray[np.float64], simplices: NDArray[np.int32]) -> float:
    corners = points[simplices]
    measure = kernels.measure(points, np.ascontiguousarray(simplices), 1)[0]
    with np.errstate(divide="ignore"):
        ratio = mean_ratio(corners[:, 1:] - corners[:, :1], measure)
        return float((1 / ratio ** points.shape[1]).sum())


def test_only_stars_below_the_threshold_are_raised(mesh: Mesh) -> None:
    start = tangle(mesh, 20, 0.3)
    points, bound = start.points.copy(), 0.3 if mesh.dimension == 3 else 0.6
    free = np.flatnonzero(mesh.movable).tolist()
    low = {v: worst_sine(points, mesh.topology.simplices[star_rows(mesh, v)[2]]) for v in free}
    stay = [v for v, sine in low.items() if sine >= bound or sine <= 0]
    for vertex in stay[:200]:
        only = mesh.movable & (np.arange(mesh.topology.n) == vertex)
        for blocks in mesh.topology.colours:
            relocate(mesh, Move.RAISE_SMALLEST, points, blocks, only, threshold_sine2=bound**2)
    assert points.tobytes() == start.points.tobytes()
    for blocks in mesh.topology.colours:
        relocate(mesh, Move.RAISE_SMALLEST, points, blocks, threshold_sine2=bound**2)
    moved = np.flatnonzero((points != start.points).any(axis=1))
    assert 10 < len(moved) < len(low)


def worst_sine(points: NDArray[np.float64], simplices: NDArray[np.int32]) -> float:
    corners = points[simplices]
    measure = kernels.measure(points, np.ascontiguousarray(simplices), 1)[0]
    return float(min_sine(corners[:, 1:] - corners[:, :1], measure).min())


def test_validity_is_relative_to_the_simplex() -> None:
    """det > 0 is too weak: a sliver at rounding error of its size is not valid, at any scale."""
    triangle = np.array([[0, 1, 2]], dtype=np.int32)
    for scale in (1e-30, 1.0, 1e30):
        for height, valid in ((1e-12, 1), (1e-16, 0), (0.0, 0), (-1.0, 0)):
            points = scale * np.array([[0.0, 0.0], [1.0, 0.0], [0.5, height]])
            assert kernels.measure(points, triangle, 1)[1][0] == valid
            assert len(kernels.check(points, triangle, 1)[0]) == 1 - valid
    tetrahedron = np.array([[0, 1, 2, 3]], dtype=np.int32)
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]])
    assert kernels.measure(points, tetrahedron, 1)[1][0] == 0


@pytest.mark.parametrize("move", [move for move in EVERYWHERE if move is not Move.COME_BACK])
def test_no_vertex_goes_beyond_its_reach(mesh: Mesh, move: Move) -> None:
    start = tangle(mesh, 5, 0.3) if move in SMOOTHING_MOVES else tangle(mesh)
    threshold = 0.01 if move is Move.MEAN_RATIO else 1.0
    for max_move in (0.0, 1e-9, 0.02):
        points = start.points.copy()
        for _ in range(3):
            for blocks in mesh.topology.colours:
                relocate(start, move, points, blocks, threshold_sine2=threshold, max_move=max_move)
        far = np.linalg.norm(points - start.points, axis=1)
        assert far.max() <= max_move
        assert (far >= 0.99 * max_move).any() or move is Move.UNTANGLE_MOST  # which goes nowhere for nothing


def test_the_linear_programme_gains_on_the_way_too(bracket: Mesh) -> None:
    """Theorem 2.1: cut short, the way to the optimum is no worse than where it began."""
    start = tangle(bracket)
    for vertex in np.flatnonzero(bracket.movable)[:200]:
        star = bracket.topology.simplices[star_rows(bracket, vertex)[2]]
        points, only = start.points.copy(), np.arange(bracket.topology.n) == vertex
        for blocks in bracket.topology.colours:
            relocate(start, Move.UNTANGLE, points, blocks, only, max_move=0.03)
        before, after = (kernels.check(p, np.ascontiguousarray(star), 1)[1] for p in (start.points, points))
        assert after >= before - 1e-15
