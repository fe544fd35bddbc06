"""The energy of curved elements, of their coefficients and scaled Jacobians, and the passes that go with it."""

from __future__ import annotations

import numpy as np
import pytest
from monomials import CODES, HIGHER, Array, derivatives, mesh_of, perturbed, positions, type_of
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.quadratic import Quadratic

every = pytest.mark.parametrize("key", [*CODES, *HIGHER])
ANYWHERE = float("inf")


@pytest.mark.parametrize("goal", [(0.3, 0.1), (0.3, 0.4, 0.1)], ids=["coefficients", "shapes"])
@every
def test_the_gradient_of_the_energy(random: np.random.Generator, key: str, goal: tuple[float, ...]) -> None:
    mesh, nodes = mesh_of(key), perturbed(random, key, 0.1)
    rest = perturbed(random, key, 0.02)
    free = np.ones(len(nodes), dtype=np.uint8)
    free[[0, -1]] = 0
    for reach in (ANYWHERE, 0.4):
        energy = kernels.QuadraticEnergy(mesh, nodes, rest, mesh.sizes(rest, 1), free, nodes + 0.01, reach, 1)
        at = 0.05 * random.normal(size=(len(nodes) - 2) * nodes.shape[1])
        _, gradient = energy.evaluate(at, *goal)
        h = 1e-6
        steps = h * np.eye(len(at))
        slopes = [(energy.evaluate(at + s, *goal)[0] - energy.evaluate(at - s, *goal)[0]) / (2 * h) for s in steps]
        np.testing.assert_allclose(gradient, slopes, atol=1e-6 * np.abs(gradient).max())


def smooth_jacobian(key: str, derivative: Array) -> float:
    """A scaled Jacobian by the derivatives, as rows, with a norm of order 8 of the products at corners."""
    shape, first, product = type_of(key).shape, 0, 1.0
    factors = {"triangle": (2,), "quadrilateral": (1, 1), "tetrahedron": (3,), "wedge": (2, 1), "hexahedron": (1, 1, 1)}
    for count in factors[shape.name]:
        ends = np.vstack([np.zeros(len(derivative)), derivative[first : first + count]])
        lengths = np.linalg.norm(ends[:, None] - ends, axis=-1) + np.eye(count + 1)
        products = lengths.prod(axis=1)
        product *= products[0] if count == 1 else (products**16).sum() ** (1 / 16)  # order 8 of the squares
        first += count
    return float(shape.weight * np.linalg.det(derivative) / product)


@every
def test_the_energy_of_shapes_is_one_of_scaled_jacobians(random: np.random.Generator, key: str) -> None:
    mesh, nodes = mesh_of(key), perturbed(random, key, 0.05)
    eps, floor, kept = 0.3, 0.2, 0.1
    free = np.ones(len(nodes), dtype=np.uint8)
    energy = kernels.QuadraticEnergy(mesh, nodes, nodes, mesh.sizes(nodes, 1), free, nodes, ANYWHERE, 1)
    at = np.zeros(nodes.size)
    values = np.array([smooth_jacobian(key, one) for one in derivatives(key, nodes, positions(key))])
    assert mesh.judge(nodes, 1)[3][0] > values.min() - 1e-10 > 0
    t = (values - floor) / (1 - floor)
    expected = ((1 + t**2) / ((t + np.sqrt(eps**2 + t**2)) / 2)).mean()
    found = energy.evaluate(at, eps, floor, kept)[0] - energy.evaluate(at, eps, kept)[0]
    assert found == pytest.approx(expected, rel=1e-8)


def test_elements_side_by_side_have_the_energies_that_they_have_alone(random: np.random.Generator) -> None:
    """However many of each type there are, and whichever of their nodes are free."""
    blocks, points, free, alone, first = [], [], [], 0.0, 0
    for key, count in (("triangle6", 7), ("quad9", 1), ("triangle10", 6), ("quad8", 5)):
        size = type_of(key).nodes
        blocks.append((key, first + np.arange(count * size).reshape(count, size)))
        first += count * size
        for _ in range(count):
            points.append(perturbed(random, key, 0.1))
            free.append((random.random(size) < 0.4).astype(np.uint8))
            alone += energy_of(mesh_of(key), points[-1], free[-1])
    mesh = Quadratic(blocks, first).kernel
    assert energy_of(mesh, np.concatenate(points), np.concatenate(free)) == pytest.approx(alone, rel=1e-12)


def energy_of(mesh: kernels.QuadraticMesh, points: Array, free: NDArray[np.uint8]) -> float:
    energy = kernels.QuadraticEnergy(mesh, points, points, mesh.sizes(points, 1), free, points, ANYWHERE, 1)
    return energy.evaluate(np.zeros(2 * int(free.sum())), 0.3, 0.2, 0.1)[0]


@every
def test_a_ceiling_is_what_free_nodes_cannot_change(random: np.random.Generator, key: str) -> None:
    """Wherever they go: the scaled Jacobians at nodes that do not change are the ceiling."""
    mesh, nodes = mesh_of(key), perturbed(random, key, 0.05)
    free = random.random(len(nodes)) < 0.2
    free[random.integers(len(nodes))] = True
    moved = nodes + 0.01 * random.normal(size=nodes.shape) * free[:, None]
    before, after = (derivatives(key, points, positions(key)) for points in (nodes, moved))
    stay = np.isclose(before, after, rtol=0, atol=1e-9).all(axis=(1, 2))
    none = np.zeros(len(nodes), dtype=np.uint8)
    assert mesh.ceilings(nodes, none, 1)[0] == mesh.judge(nodes, 1)[3][0]
    found = mesh.ceilings(nodes, free.astype(np.uint8), 1)[0]
    values = [mesh.judge(points, 1)[3][0] for points in (nodes, moved)]
    if not stay.any():
        assert found == np.inf
    else:
        assert found >= max(values) - 1e-9
        at = before[stay]
        lowest = min(smooth_jacobian(key, one) for one in at)  # no larger than the scaled Jacobian, by little
        assert lowest - 1e-9 <= found <= 1.2 * lowest


def test_some_elements_are_judged_as_all_are(random: np.random.Generator) -> None:
    rows = np.arange(100 * 10).reshape(100, 10)
    points = np.concatenate([perturbed(random, "tetra10", 0.05) for _ in rows])
    mesh = Quadratic([("tetra10", rows)], len(points))
    before = mesh.judge(points, 1)
    moved = np.zeros(len(points), dtype=bool)
    moved[rows[random.permutation(100)[:30], 4]] = True
    points[moved] += 0.3
    again = mesh.judge_again(before, moved, points, 1)
    expected = mesh.judge(points, 1)
    for name in expected._fields:
        assert getattr(again, name).tobytes() == getattr(expected, name).tobytes() != getattr(before, name).tobytes()


def test_the_energy_has_the_same_bits_for_any_number_of_threads(random: np.random.Generator) -> None:
    rows = np.arange(200 * 10, dtype=np.int32).reshape(200, 10)
    rows[1:, 0] = rows[:-1, 1]  # a chain of elements, each from a node of the one before
    points = np.concatenate([perturbed(random, "tetra10", 0.05) for _ in rows])
    mesh = kernels.QuadraticMesh(np.full(200, CODES["tetra10"], dtype=np.uint8), rows.ravel(), len(points))
    sizes, free = np.ones(200), (random.random(len(points)) < 0.7).astype(np.uint8)
    found = []
    for threads in (1, 2, 3):
        energy = kernels.QuadraticEnergy(mesh, points, points, sizes, free, points, ANYWHERE, threads)
        found.append((energy.minimise(0.5, 0.0, 20), energy.points(3).tobytes()))
    assert found[0] == found[1] == found[2]
