"""Elements of every type are untangled with a certificate, and smoothed without losing it."""

from __future__ import annotations

import numpy as np
import pytest
from elements import MESHES, box_of_hexahedra, tangles
from meshes import with_a_rough_boundary
from numpy.typing import NDArray
from sampling import jacobians
from scipy.optimize import linprog, minimize

from meshfix_cli import Mesh, kernels, untangle
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.quality.summary import summarise
from meshfix_cli.solve.foldover import embedding
from meshfix_cli.solve.records import Outcome
from meshfix_cli.solve.run import CORNER_KEPT
from meshfix_cli.solve.strategies import STRATEGIES, Move, Smooth
from meshfix_cli.solve.untangle import steps

# Of the scaled Jacobians of the mesh before: the smallest, and the mean where nothing turned.
SMALLEST, MEAN = 0.47, 0.94
SHEARED = 0.75


def built(name: str) -> Mesh:
    return Mesh.build(*MESHES[name]())


def positive_everywhere(mesh: Mesh) -> bool:
    return all((jacobians(mesh.points, b.element.key, b.vertices) > 0).all() for b in mesh.topology.blocks)


def moved(outcome: Outcome) -> NDArray[np.bool_]:
    return np.asarray((outcome.before.points != outcome.after.points).any(axis=1))


@pytest.mark.parametrize("name", sorted(MESHES))
def test_whatever_the_tangle_the_mesh_becomes_valid_and_good(name: str) -> None:
    mesh = built(name)
    before = summarise(mesh).jacobians
    assert before is not None
    for how, points in tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length()).items():
        outcome = untangle(mesh.with_points(points))
        assert outcome.records[0].inverted > 0
        assert outcome.valid, how
        assert positive_everywhere(outcome.after), how
        assert not (moved(outcome) & ~mesh.movable).any()
        after = summarise(outcome.after).jacobians
        assert after is not None
        assert after.smallest >= SMALLEST * before.smallest, how
        assert after.mean >= (SHEARED if "turned" in how else MEAN) * before.mean, how


@pytest.mark.parametrize("name", ["quad rings", "hex shell", "every solid"])
@pytest.mark.parametrize("strategy", ["LUS", "US", "CS", "FF"])
def test_each_strategy_ends_with_a_certificate_or_says_so(name: str, strategy: str) -> None:
    mesh = built(name)
    points = tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length())["P=25 D=2h"]
    outcome = untangle(mesh.with_points(points), strategy)
    assert outcome.records[-1].inverted == outcome.after.check()[0]
    assert outcome.valid == (outcome.after.check()[0] == 0)
    assert outcome.records[-1].inverted < outcome.records[0].inverted / 2
    assert outcome.valid or (strategy != "FF" and name != "quad rings")


@pytest.mark.parametrize("name", ["quads and triangles", "hex shell", "wedges and tets", "every solid"])
@pytest.mark.parametrize("smooth", ["auto", "best"])
def test_same_bits_for_any_threads(name: str, smooth: Smooth) -> None:
    mesh = built(name)
    points = tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length())["P=100 D=8h"]
    ends = {untangle(mesh.with_points(points), smooth=smooth, threads=n).after.points.tobytes() for n in (1, 2, 3)}
    assert len(ends) == 1


@pytest.mark.parametrize("name", ["quad rings", "hex shell", "hex plate", "every solid"])
@pytest.mark.parametrize("smooth", ["auto", "best"])
def test_smoothing_lets_no_edge_shrink_to_nothing(name: str, smooth: Smooth) -> None:
    """Scaled Jacobians do not mind that: the smallest corner of what was untangled tells how small one may be."""
    mesh = built(name)
    for points in tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length()).values():
        outcome = untangle(mesh.with_points(points), smooth=smooth)
        assert outcome.after.check()[1] >= CORNER_KEPT * outcome.untangled.check()[1] > 0


@pytest.mark.parametrize("seed", [0, 5, 10, 11])
def test_what_is_impossible_takes_no_others_with_it(seed: int) -> None:
    """Corners that are held the wrong way round spoil their element alone, and not those that share its vertices."""
    rough = with_a_rough_boundary(Mesh.build(*box_of_hexahedra(27)), 0.5, seed)
    outcome = untangle(rough, smooth=0)
    phases = [phase for phase in STRATEGIES["auto"] if Move.UNTANGLE_MOST not in phase.moves]
    *_, (_, without) = steps(rough, phases, hopeless=outcome.obstacles.hopeless(rough))
    assert len(outcome.obstacles.inverted) <= outcome.records[-1].inverted < without.inverted
    assert outcome.records[-1].inverted == outcome.after.check()[0]


def test_best_is_no_worse_than_the_default() -> None:
    for name in ("quad plate", "hex plate", "wedges on tets", "every solid"):
        mesh = built(name)
        points = tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length())["P=25 D=2h"]
        default, best = (
            untangle(mesh.with_points(points), smooth=smooth).after for smooth in ("auto", "best")
        )  # fmt: skip
        quality = [Judged(m.topology.connectivity).angles(m.along_curve(m.points), 1).min() for m in (default, best)]
        assert quality[1] >= quality[0] - np.radians(0.1)
        assert best.check()[0] == 0


@pytest.mark.parametrize("name", ["graded quads", "graded hexes"])
def test_the_embedding_gives_a_grid_its_spacing_back(name: str) -> None:
    mesh = built(name)
    points, stars = mesh.along_curve(mesh.points), mesh.topology.stars()
    free = mesh.along_curve(mesh.movable)
    middle = np.where(free[:, None], points.mean(axis=0), points)
    np.testing.assert_allclose(embedding(middle, stars, free), points, atol=1e-4 * np.ptp(points))


@pytest.mark.parametrize("name", ["hex shell", "wedges and tets"])
def test_only_what_must_move_moves(name: str) -> None:
    mesh = built(name)
    points = mesh.points.copy()
    vertex = int(np.argmin(np.where(mesh.movable, np.linalg.norm(points - points.mean(axis=0), axis=1), np.inf)))
    points[vertex] += 1.5 * mesh.mean_edge_length()
    tangled = mesh.with_points(points)
    assert tangled.check()[0] > 0
    outcome = untangle(tangled, smooth=0, only_invalid=True)
    assert outcome.valid
    assert moved(outcome)[vertex]
    assert moved(outcome).sum() <= 20
    best = untangle(tangled, smooth="best", only_invalid=True)
    assert best.valid
    assert not (moved(best) & ~mesh.topology.grown(np.arange(mesh.topology.n) == vertex, 3)).any()
    bound = 2.5 * mesh.mean_edge_length()
    bounded = untangle(tangled, max_move=bound)
    assert bounded.valid
    assert np.linalg.norm(bounded.after.points - points, axis=1).max() <= bound


def one_star(random: np.random.Generator, spread: float) -> tuple[Mesh, int]:
    """Eight cubes about one free vertex, all their nodes perturbed."""
    axis = np.arange(3.0)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(27).reshape(3, 3, 3)
    rows = [
        [number[i + a, j + b, k + c] for a, b, c in
         ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))]
        for i in range(2) for j in range(2) for k in range(2)
    ]  # fmt: skip
    points += random.normal(scale=spread, size=points.shape)
    return Mesh.build(points, [("hexahedron", np.array(rows))]), 13


def once(mesh: Mesh, move: Move) -> NDArray[np.float64]:
    """The points (n, 3) after one visit of the free vertices."""
    stars, points = mesh.topology.stars(), mesh.along_curve(mesh.points)
    states = mesh.along_curve(mesh.movable).astype("u1") * kernels.DUE
    for blocks in mesh.topology.colours:
        kernels.relocate(move, points, states, stars, blocks, 1.0, -np.inf, points.copy(), np.inf, 1)
    return mesh.topology.of_vertices(points)


def test_the_programme_on_coefficients_is_that_of_highs(random: np.random.Generator) -> None:
    """Its success is a certificate; heights over the columns' gradients are maximised, where they can be positive."""
    certified = valid = 0
    for _ in range(40):
        mesh, vertex = one_star(random, 0.25)
        rows = mesh.topology.blocks[0].vertices
        columns = [kernels.coefficient_columns(mesh.points[row], 5, int(np.argmax(row == vertex))) for row in rows]
        values, gradients = (np.concatenate(part) for part in zip(*columns, strict=True))
        assert len(values) == 8 * 20
        lengths = np.linalg.norm(gradients, axis=1)
        c, n = values / lengths, gradients / lengths[:, None]
        result = linprog([0, 0, 0, -1], np.c_[-n, np.ones(len(n))], c, bounds=[(None, None)] * 4)
        if not (result.status == 0 and result.x[3] > 1e-3):
            continue
        x = once(mesh, Move.UNTANGLE_COEFFICIENTS)[vertex]
        assert (c + n @ x).min() > 0.999 * result.x[3]
        certified += 1
        after = mesh.with_points(once(mesh, Move.UNTANGLE_COEFFICIENTS))
        if all((kernels.coefficients(after.points[row], 5) > 0).all() for row in rows):  # those of others may not be
            assert after.check()[0] == 0
            valid += 1
    assert certified > 10
    assert valid > 5


def smallest(mesh: Mesh) -> float:
    return float(Judged(mesh.topology.connectivity).angles(mesh.along_curve(mesh.points), 1).min())


def test_the_active_set_method_finds_the_best_place_of_a_vertex(random: np.random.Generator) -> None:
    for _ in range(8):
        mesh, vertex = one_star(random, 0.12)
        if mesh.check()[0] > 0:
            continue
        points = once(mesh, Move.RAISE_SMALLEST)

        def lost(x: NDArray[np.float64], mesh: Mesh = mesh, vertex: int = vertex) -> float:
            there = mesh.points.copy()
            there[vertex] = x
            return -smallest(mesh.with_points(there))

        best = minimize(lost, points[vertex], method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-8})
        assert smallest(mesh.with_points(points)) >= 0.98 * -best.fun
        assert smallest(mesh.with_points(points)) >= smallest(mesh)  # where other corners are no worse


@pytest.mark.parametrize("move", [Move.COMBINED_SMOOTH, Move.SMART_LAPLACIAN, Move.MEAN_RATIO, Move.RAISE_SMALLEST])
def test_smoothing_never_makes_a_valid_element_invalid_inside(random: np.random.Generator, move: Move) -> None:
    """Flat hexahedra, whose corners say little of what is inside."""
    tried = 0
    for _ in range(200):
        mesh, _ = one_star(random, 0.2)
        mesh = mesh.with_points(mesh.points * [1, 1, 0.25])
        if mesh.check()[0] == 0:
            tried += 1
            assert mesh.with_points(once(mesh, move)).check()[0] == 0
    assert tried > 10


@pytest.mark.parametrize(("sharpness", "evenness"), [(0.0, 0.0), (5.0, 0.0), (15.0, 0.0), (15.0, 8.0), (0.0, 2.0)])
def test_the_energy_of_corners_has_the_gradient_of_its_values(
    random: np.random.Generator, sharpness: float, evenness: float
) -> None:
    mesh, vertex = one_star(random, 0.1)
    corners, free = mesh.topology.stars().simplices, 27
    points = np.ascontiguousarray(mesh.along_curve(mesh.points))
    weights = np.ones(len(corners))
    weights[:8] = 0.0
    owners = np.ascontiguousarray(mesh.topology.stars().owners)
    hexahedra = mesh.topology.stars().nodes.reshape(-1, 8).copy()
    hexahedra[1:3] = -1  # as if they had no centre
    goal = (40.0, 20.0, 0.0, 1.5, sharpness, evenness)

    def value(x: NDArray[np.float64]) -> float:
        return kernels.shape_energy(x, corners, weights, owners, hexahedra, free, *goal, 1)[0]

    _, gradient = kernels.shape_energy(points, corners, weights, owners, hexahedra, free, *goal, 1)
    size2 = ((points - points.mean(axis=0)) ** 2).sum(axis=1).max()
    unit = np.sqrt(size2) / np.cbrt(len(points))
    for place in [(vertex, 0), (3, 1), (20, 2), (0, 0)]:
        step = np.zeros_like(points)
        # The frame of the energy is fixed by the points that it is made with: two opposite moves keep its origin.
        step[place] = 1e-6
        numeric = (value(points + step) - value(points - step)) / 2e-6
        assert abs(numeric * unit - gradient[place]) < 0.02 * np.abs(gradient).max()
