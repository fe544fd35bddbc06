"""Bezier coefficients of curved elements against det J itself, and what is built upon them."""

from __future__ import annotations

import numpy as np
import pytest
from monomials import (
    CODES,
    HIGHER,
    Array,
    coefficients,
    derivatives,
    inside,
    jacobians,
    mesh_of,
    order_of,
    perturbed,
    positions,
    type_of,
)
from numpy.typing import NDArray
from scipy.optimize import linprog, minimize

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.judged import CORNER, INSIDE, VALID
from meshfix_cli.quality.formulas import evaluate_at

COUNTS = {
    "triangle6": 6, "quad8": 16, "quad9": 16, "tetra10": 20, "wedge15": 90, "wedge18": 90, "hexahedron20": 216,
    "hexahedron27": 216, "triangle10": 15, "triangle15l": 28, "quad16": 36, "quad25l": 64, "tetra20": 84,
    "tetra35l": 220, "wedge40": 36 * 9, "hexahedron64": 9**3,
}  # fmt: skip
every = pytest.mark.parametrize("key", [*CODES, *HIGHER])
ANYWHERE = float("inf")


@pytest.mark.parametrize("key", list(CODES))
def test_the_table_is_that_of_the_elements(key: str) -> None:
    dimension, between, weight = kernels.QUADRATIC_SHAPES[CODES[key]]
    element = type_of(key)
    assert (dimension, len(between)) == (element.shape.dimension, element.nodes)
    assert between[: element.shape.corners] == [[i] for i in range(element.shape.corners)]
    assert weight == pytest.approx(element.shape.weight)


@every
def test_coefficients_bound_the_jacobian_and_have_its_mean(random: np.random.Generator, key: str) -> None:
    for size in (0.02, 0.1, 0.3):
        nodes = perturbed(random, key, size)
        found = coefficients(key, nodes)
        values = jacobians(key, nodes, inside(random, key, 500))
        rounding = (1e-12 if key in CODES else 1e-10) * np.abs(found).max()  # most of it that of the monomials
        assert len(found) == COUNTS[key]
        assert found.min() <= values.min() + rounding
        assert found.max() >= values.max() - rounding
        corners = jacobians(key, nodes, positions(key)[: type_of(key).shape.corners])
        assert np.abs(corners[:, None] - found).min(axis=1).max() < rounding  # they are among them


@every
def test_a_straight_element_has_the_jacobian_of_its_map(random: np.random.Generator, key: str) -> None:
    d = type_of(key).shape.dimension
    linear = np.eye(d) + 0.3 * random.normal(size=(d, d))
    found = coefficients(key, positions(key) @ linear.T)
    np.testing.assert_allclose(found, np.linalg.det(linear), rtol=1e-12)
    verdict, smallest, *_ = mesh_of(key).judge(positions(key) @ linear.T, 1)
    assert smallest[0] == pytest.approx(np.sign(np.linalg.det(linear)) if np.linalg.det(linear) > 0 else smallest[0])
    assert (verdict[0] == VALID) == (np.linalg.det(linear) > 0)


@every
def test_measures_are_integrals(random: np.random.Generator, key: str) -> None:
    nodes = perturbed(random, key, 0.05)
    unit = {"triangle": 0.5, "quadrilateral": 1.0, "tetrahedron": 1 / 6, "wedge": 0.5, "hexahedron": 1.0}
    values = jacobians(key, nodes, inside(random, key, 20000))
    measure = mesh_of(key).judge(nodes, 1)[2][0]
    error = 6 * values.std() / np.sqrt(len(values)) * unit[type_of(key).shape.name]
    assert measure == pytest.approx(values.mean() * unit[type_of(key).shape.name], abs=error)


@every
def test_scaled_jacobians_are_of_the_worst_corner_at_each_node(random: np.random.Generator, key: str) -> None:
    """A triangle or tetrahedron of derivatives has several corners: it is no matter with which the file begins."""
    element, d = type_of(key), type_of(key).shape.dimension
    for size in (0.0, 0.05, 0.3):
        nodes = perturbed(random, key, size) @ (np.eye(d) + 0.2 * random.normal(size=(d, d)))
        expected = []
        for along in derivatives(key, nodes, positions(key)):
            corners, line = [along], 1.0
            if element.shape.name in ("triangle", "tetrahedron", "wedge"):
                ends = np.concatenate([np.zeros((1, d)), along[: 2 if element.shape.name == "wedge" else d]])
                corners = [np.delete(ends - end, i, axis=0) for i, end in enumerate(ends)]
                line = float(np.linalg.norm(along[2])) if element.shape.name == "wedge" else 1.0
            longest = line * max(np.linalg.norm(edges, axis=1).prod() for edges in corners)
            expected.append(element.shape.weight * np.linalg.det(along) / longest)
        assert mesh_of(key).judge(nodes, 1)[3][0] == pytest.approx(min(expected), abs=1e-12 if key in CODES else 1e-10)


@pytest.mark.parametrize("key", ["triangle6", "tetra10"])
def test_scaled_jacobians_of_straight_simplices_are_verdicts(random: np.random.Generator, key: str) -> None:
    corners = positions(key)[: type_of(key).shape.corners]
    for _ in range(20):
        nodes = corners + 0.2 * random.normal(size=corners.shape)
        means = np.array([nodes[mean].mean(axis=0) for mean in kernels.QUADRATIC_SHAPES[CODES[key]][1]])
        straight = ELEMENTS[{"triangle6": "triangle", "tetra10": "tetra"}[key]]
        expected = evaluate_at("scaled_jacobian", straight, nodes[None])[0]
        assert mesh_of(key).judge(means, 1)[3][0] == pytest.approx(expected, abs=1e-12)


@every
def test_coefficients_are_affine_in_nodes_that_move_together(random: np.random.Generator, key: str) -> None:
    nodes, shares = perturbed(random, key, 0.1), random.random(type_of(key).nodes)
    step = random.normal(size=nodes.shape[1])
    before, after = (coefficients(key, p) for p in (nodes, nodes + shares[:, None] * step))
    columns = mesh_of(key).columns(nodes, shares)
    np.testing.assert_allclose(before + columns @ step, after, atol=1e-12 * np.abs(after).max())


def doubtful(random: np.random.Generator, key: str, count: int) -> list[Array]:
    """Return elements about at the limit of being valid."""
    found: list[Array] = []
    while len(found) < count:
        nodes = perturbed(random, key, random.choice([0.03, 0.06, 0.1]))
        if coefficients(key, nodes).min() < 0.2:
            found.append(nodes)
    return found


def at_the_rim(random: np.random.Generator, key: str, count: int) -> Array:
    """Return parameters (count, d), most of them near the facets and edges of a type."""
    if type_of(key).shape.name in ("triangle", "tetrahedron"):
        d = type_of(key).shape.dimension
        return random.dirichlet(np.full(d + 1, 0.2), count)[:, :d]
    at = random.beta(0.2, 0.2, (count, type_of(key).shape.dimension))
    if key.startswith("wedge"):
        at[:, :2] = random.dirichlet(np.full(3, 0.2), count)[:, :2]
    return at


def deepest(random: np.random.Generator, key: str, nodes: Array, at: Array) -> float:
    """Return about the smallest det J of an element: samples, and then samples on the way to the deepest."""
    at = np.concatenate([at, at_the_rim(random, key, 1000)])
    for share in (0.5, 0.25, 0.1, 0.05, 0.02, 0.01):
        values = jacobians(key, nodes, at)
        lowest = at[np.argmin(values)]
        at = np.concatenate([[lowest], lowest + share * (at_the_rim(random, key, 300) - lowest)])
    return float(jacobians(key, nodes, at).min())


def descended(key: str, nodes: Array, at: Array) -> float:
    """Return det J at the deepest of the minima that are below the deepest of some samples."""
    name = type_of(key).shape.name
    simplex = {"triangle": 2, "wedge": 2, "tetrahedron": 3}.get(name, 0)
    within = [{"type": "ineq", "fun": lambda x: 1 - x[:simplex].sum()}] if simplex else []
    lowest = at[np.argsort(jacobians(key, nodes, at))[:40]]
    found = [
        minimize(
            lambda x: jacobians(key, nodes, x[None])[0], x, method="SLSQP", bounds=[(0, 1)] * len(x), constraints=within
        )
        for x in lowest
    ]
    return float(min(one.fun for one in found))


@every
def test_verdicts_against_sampling(random: np.random.Generator, key: str) -> None:
    seen = set()
    at = np.concatenate([inside(random, key, 3000), positions(key)])
    for nodes in doubtful(random, key, 60 if key in CODES else 20):
        verdict = mesh_of(key).judge(nodes, 1)[0][0]
        seen.add(int(verdict))
        smallest = deepest(random, key, nodes, at)
        if smallest <= 0:
            assert verdict != VALID
        if verdict == CORNER:
            assert jacobians(key, nodes, positions(key)).min() <= 1e-10
        if verdict == INSIDE:  # the samples are near to where it is not positive
            assert smallest < 1e-3 or descended(key, nodes, at) < 1e-3
    assert seen >= {VALID, CORNER}


@every
def test_what_is_not_a_number_is_not_valid(key: str) -> None:
    nodes = positions(key)
    nodes[-1, 0] = np.nan
    assert mesh_of(key).judge(nodes, 1)[0][0] != VALID


@every
def test_verdicts_do_not_depend_on_where_and_how_large(random: np.random.Generator, key: str) -> None:
    for nodes in doubtful(random, key, 10):
        verdict = mesh_of(key).judge(nodes, 1)[0][0]
        for scale in (2.0**-40, 2.0**30):
            assert mesh_of(key).judge(scale * nodes, 1)[0][0] == verdict


@every
def test_the_programme_of_a_node_against_highs(random: np.random.Generator, key: str) -> None:
    """One sweep over one node: the smallest coefficient is that of the best position, as HiGHS finds it."""
    mesh, node = mesh_of(key), type_of(key).nodes - 1
    for nodes in doubtful(random, key, 5):
        sizes, free = mesh.sizes(nodes, 1), np.ones(len(nodes), dtype=np.uint8)
        visited = np.array([node], dtype=np.int32)
        moved, count = mesh.relocate(nodes, sizes, free, visited, nodes, ANYWHERE, 1.0, False)
        shares = np.zeros(len(nodes))
        shares[node] = 1
        columns = mesh_of(key).columns(nodes, shares) / sizes[0]
        values = coefficients(key, nodes) / sizes[0]
        depends = np.linalg.norm(columns, axis=1) > 1e-6 * np.linalg.norm(columns, axis=1).max()
        columns, values = columns[depends], values[depends]
        d = nodes.shape[1]
        radius = np.linalg.norm(nodes - nodes[node], axis=1).max()
        best = linprog(
            [*np.zeros(d), -1], np.hstack([-columns, np.ones((len(values), 1))]), values,
            bounds=[*[(-radius, radius)] * d, (None, None)],
        )  # fmt: skip
        reached = (coefficients(key, moved) / sizes[0])[depends].min()
        if count:
            assert reached > values.min()
        # Ours has a box along axes of its own.
        inside_of_both = (
            np.linalg.norm(best.x[:d]) < 0.9 * radius and np.linalg.norm(moved[node] - nodes[node]) < 0.9 * radius
        )
        if inside_of_both and best.x[d] > values.min() + 1e-5:
            assert reached == pytest.approx(best.x[d], abs=1e-8)


@every
def test_the_programme_of_parts_makes_det_j_positive_in_more(random: np.random.Generator, key: str) -> None:
    """Its optimum is between that of whole elements and that of det J at places, as HiGHS finds it."""
    mesh, node, places = mesh_of(key), type_of(key).shape.corners, lattice(key)
    visited = np.array([node], dtype=np.int32)
    others = dependence(random, key, places)[:, node]
    seen = 0
    for nodes in doubtful(random, key, 12):
        sizes, free = mesh.sizes(nodes, 1), np.ones(len(nodes), dtype=np.uint8)
        most = optimum(key, nodes, [list(range(len(nodes)))], node, [places[others]])
        reached = []
        for halvings in (0, 3):
            moved, count = mesh.relocate(nodes, sizes, free, visited, nodes, ANYWHERE, 1.0, False, halvings)
            if not count:
                break
            value = jacobians(key, moved, places[others]).min()
            assert min(value, 1.0) <= most + 1e-9
            reached.append(value)
        seen += len(reached) == 2 and reached[1] > reached[0] + 1e-9
    assert seen


@pytest.mark.parametrize("tied", [False, True])
def test_a_sweep_of_the_programme_stays_in_reach(random: np.random.Generator, tied: bool) -> None:
    mesh, nodes = mesh_of("tetra10"), perturbed(random, "tetra10", 0.2)
    free, visited = np.ones(10, dtype=np.uint8), np.arange(4 if tied else 10, dtype=np.int32)
    moved, count = mesh.relocate(nodes, mesh.sizes(nodes, 1), free, visited, nodes, 0.01, 1.0, tied)
    assert count
    assert np.linalg.norm(moved - nodes, axis=1).max() <= 0.01


def test_what_no_free_node_changes_is_proved() -> None:
    """A triangle between two held edges whose tangents have turned past each other at their common corner."""
    nodes = positions("triangle6")
    nodes[3], nodes[5] = [0.3, 0.4], [0.4, 0.3]
    free = np.zeros(6, dtype=np.uint8)
    free[4] = 1
    assert mesh_of("triangle6").impossible(nodes, free).tolist() == [1]
    assert mesh_of("triangle6").impossible(positions("triangle6"), free).tolist() == [0]


def lattice(key: str) -> Array:
    """Return the parameters of places in a type, its nodes among them where these are evenly spaced."""
    steps, d, name = 2 * order_of(key), type_of(key).shape.dimension, type_of(key).shape.name
    at = np.stack(np.meshgrid(*[np.arange(steps + 1)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    simplex = {"triangle": 2, "wedge": 2, "tetrahedron": 3}.get(name, 0)
    return at[at[:, :simplex].sum(axis=1) <= steps] / steps


def dependence(random: np.random.Generator, key: str, at: Array) -> NDArray[np.bool_]:
    """Return on which nodes (k, nodes) det J depends at parameters."""
    nodes = perturbed(random, key, 0.1)
    found = np.empty((len(at), len(nodes)), dtype=bool)
    for node in range(len(nodes)):
        moved = nodes.copy()
        moved[node] += random.normal(size=nodes.shape[1])
        found[:, node] = np.abs(jacobians(key, moved, at) - jacobians(key, nodes, at)) > 1e-9
    return found


def optimum(key: str, points: Array, rows: list[list[int]], node: int, at: list[Array]) -> float:
    """Return the largest smallest det J of elements at parameters `at` of each, wherever one node goes; at most 1."""
    columns, values = [], []
    for row, places in zip(rows, at, strict=True):
        here, place = points[row], row.index(node)
        values.append(jacobians(key, here, places))
        columns.append([jacobians(key, here + np.outer(np.arange(len(row)) == place, step), places) - values[-1]
                        for step in np.eye(points.shape[1])])  # fmt: skip
    slopes, least = np.concatenate(columns, axis=1).T, np.concatenate(values)
    d = points.shape[1]
    best = linprog(
        [*np.zeros(d), -1],
        np.hstack([-slopes, np.ones((len(least), 1))]),
        least,
        bounds=[*[(-1e3, 1e3)] * d, (None, 1)],
    )
    return float(best.x[d])


@every
def test_what_one_free_node_cannot_mend_is_proved(random: np.random.Generator, key: str) -> None:
    """An element of which one node is free, as HiGHS finds it: at places of another basis, and at denser ones."""
    mesh, places = mesh_of(key), lattice(key)
    depends, seen = dependence(random, key, places), set()
    for _ in range(60):
        points, node = perturbed(random, key, random.choice([0.05, 0.1])), int(random.integers(type_of(key).nodes))
        free = (np.arange(len(points)) == node).astype(np.uint8)
        fixed = jacobians(key, points, places)[~depends[:, node]].min(initial=1.0)
        best = optimum(key, points, [list(range(len(points)))], node, [places[depends[:, node]]])
        if abs(fixed) < 1e-9 or abs(best) < 1e-9:
            continue
        mark = mesh.impossible(points, free)[0]
        assert mark == (fixed < 0 or best < 0)
        seen.add(int(mark))
        if mark:  # no position is any good
            for step in random.normal(size=(8, points.shape[1])):
                moved = points + np.outer(free, step)
                assert mesh.judge(moved, 1)[0][0] != VALID
    assert seen == {0, 1}


@every
def test_what_is_fixed_and_not_valid_is_proved(random: np.random.Generator, key: str) -> None:
    """Also where it is invalid inside alone."""
    mesh, free = mesh_of(key), np.zeros(type_of(key).nodes, dtype=np.uint8)
    for nodes in doubtful(random, key, 40):
        assert mesh.impossible(nodes, free)[0] == (mesh.judge(nodes, 1)[0][0] != VALID)


def around_an_edge() -> tuple[Array, list[list[int]], int]:
    """Return straight tetrahedra of second order around one edge: points, elements, and the middle of the edge."""
    around = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], dtype=float)
    corners = np.concatenate([[[0, 0, 0], [0, 0, 1]], around + np.array([0, 0, 0.5])])
    between = kernels.QUADRATIC_SHAPES[CODES["tetra10"]][1]
    numbers: dict[tuple[int, ...], int] = {}
    rows = []
    for k in range(4):
        tetra = [0, 2 + k, 2 + (k + 1) % 4, 1]
        ends = [tuple(sorted(tetra[c] for c in mean)) for mean in between]
        rows.append([one[0] if len(one) == 1 else numbers.setdefault(one, 6 + len(numbers)) for one in ends])
    points = np.concatenate([corners, [corners[list(ends)].mean(axis=0) for ends in numbers]])
    return points, rows, numbers[0, 1]


def mesh_around(rows: list[list[int]], n: int) -> kernels.QuadraticMesh:
    codes = np.full(len(rows), CODES["tetra10"], dtype=np.uint8)
    return kernels.QuadraticMesh(codes, np.array(rows, dtype=np.int32).ravel(), n)


def expected(points: Array, rows: list[list[int]], free: set[int], depends: NDArray[np.bool_]) -> tuple[Array, float]:
    """Return for each element the smallest det J that nothing free changes, and the worst optimum of one free node."""
    places, best, fixed = lattice("tetra10"), 1.0, []
    for row in rows:
        changed = (np.isin(row, list(free)) & depends).any(axis=1)
        fixed.append(jacobians("tetra10", points[row], places[~changed]).min(initial=1.0))
    for node in free:
        some, at = [row for row in rows if node in row], []
        for row in some:
            others = (np.isin(row, list(free - {node})) & depends).any(axis=1)
            at.append(places[depends[:, row.index(node)] & ~others])
        if any(map(len, at)):
            best = min(best, optimum("tetra10", points, some, node, at))
    return np.array(fixed), best


def test_what_no_node_common_to_elements_mends_is_proved_together(random: np.random.Generator) -> None:
    """The middle of one edge alone is free: proved where HiGHS finds no position, at both of its ends and between."""
    straight, rows, middle = around_an_edge()
    mesh, depends = mesh_around(rows, len(straight)), dependence(random, "tetra10", lattice("tetra10"))
    free, seen = (np.arange(len(straight)) == middle).astype(np.uint8), set()
    for _ in range(100):
        points = straight + 0.12 * random.normal(size=straight.shape) * (np.arange(len(straight)) > 5)[:, None]
        marks = mesh.impossible(points, free)
        fixed, best = expected(points, rows, {middle}, depends)
        assert (marks > 0).any() == (fixed.min() < 0 or best < 0)
        assert (marks[fixed < 0] == 1).all()
        seen.add(bool((marks == 2).any()))
        if (marks == 2).any():  # these few exclude each other already
            some = [row for row, one in zip(rows, marks > 0, strict=True) if one]
            assert expected(points, some, {middle}, depends)[1] < 1e-9
    assert seen == {False, True}


def test_what_no_tangent_of_a_common_edge_mends_is_proved_together(random: np.random.Generator) -> None:
    """The far end of the edge is free as well: what is left are the corners at the near end, as HiGHS finds it."""
    straight, rows, middle = around_an_edge()
    mesh, depends = mesh_around(rows, len(straight)), dependence(random, "tetra10", lattice("tetra10"))
    free, corner = np.isin(np.arange(len(straight)), [middle, 1]).astype(np.uint8), positions("tetra10")[:1]
    seen = set()
    for _ in range(200):
        points = straight + 0.2 * random.normal(size=straight.shape) * (np.arange(len(straight)) > 5)[:, None]
        marks = mesh.impossible(points, free)
        tangent = optimum("tetra10", points, rows, middle, [corner] * len(rows))
        fixed, best = expected(points, rows, {middle, 1}, depends)
        assert (marks > 0).any() == (min(fixed.min(), best, tangent) < 1e-9)  # without a tangent all are 0
        seen.add((bool((marks > 0).any()), tangent < 1e-9 and min(fixed.min(), best) > 0))
    assert seen == {(False, False), (True, False), (True, True)}
