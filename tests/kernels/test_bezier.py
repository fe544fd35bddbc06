"""Bezier coefficients of det J against its values, and against themselves with a node moved."""

from __future__ import annotations

import numpy as np
import pytest
from isoparametric import CODES, Array, jacobians, judged, perturbed, quadrature, regular, shape_functions

from meshfix_cli import kernels

DEPENDENT = {  # coefficients that depend on a node; at an apex, on the last
    "triangle": (1, 1), "quad": (3, 3), "tetra": (1, 1), "pyramid": (3, 4), "wedge": (7, 7), "hexahedron": (20, 20),
}  # fmt: skip
every = pytest.mark.parametrize("key", list(CODES))


def quadratic(t: Array) -> Array:
    """Bernstein polynomials (k, 3) of degree 2."""
    return np.stack([(1 - t) ** 2, 2 * t * (1 - t), t**2], axis=1)


def bernstein(key: str, at: Array) -> Array:
    """The polynomials (k, number of coefficients) that the coefficients multiply, at parameters (k, d)."""
    if key in ("triangle", "tetra"):
        return np.ones((len(at), 1))
    if key == "quad":
        return shape_functions("quad", at)
    if key == "pyramid":
        return shape_functions("quad", at[:, :2]) * (1 - at[:, 2:]) ** 2
    if key == "wedge":
        return np.concatenate(
            [shape_functions("triangle", at[:, :2]) * quadratic(at[:, 2])[:, [k]] for k in (0, 2, 1)], axis=1
        )
    corners = (2 * regular(key)).astype(int)
    cube = [(i, j, k) for k in range(3) for j in range(3) for i in range(3)]
    order = [*map(tuple, corners.tolist()), *(place for place in cube if 1 in place)]
    x, y, z = (quadratic(at[:, axis]) for axis in range(3))
    return np.stack([x[:, i] * y[:, j] * z[:, k] for i, j, k in order], axis=1)


@every
def test_coefficients_are_those_of_the_jacobian(random: np.random.Generator, key: str) -> None:
    at, _ = quadrature(key)
    for nodes in perturbed(random, key, 20):
        coefficients = kernels.coefficients(nodes, CODES[key])
        expected = jacobians(key, nodes, at)
        np.testing.assert_allclose(bernstein(key, at) @ coefficients, expected, atol=1e-12 * np.abs(coefficients).max())


@every
def test_the_first_coefficients_are_those_at_the_corner_simplices(random: np.random.Generator, key: str) -> None:
    nodes = perturbed(random, key, 1)[0]
    rows = np.array(kernels.SHAPES[CODES[key]][2])
    edges = nodes[rows[:, 1:]] - nodes[rows[:, :1]]
    coefficients = kernels.coefficients(nodes, CODES[key])
    np.testing.assert_allclose(coefficients[: len(rows)], np.linalg.det(edges), atol=1e-13)


@every
def test_columns_are_the_coefficients_that_depend_on_a_node(random: np.random.Generator, key: str) -> None:
    for nodes in perturbed(random, key, 10):
        for node in range(len(nodes)):
            places = random.uniform(-1, 2, (5, nodes.shape[1]))
            variants = np.repeat(nodes[None], len(places), axis=0)
            variants[:, node] = places
            coefficients = np.array([kernels.coefficients(v, CODES[key]) for v in variants])
            expected = coefficients[:, (coefficients != coefficients[0]).any(axis=0)]
            values, gradients = kernels.coefficient_columns(nodes, CODES[key], node)
            assert len(values) == expected.shape[1] == DEPENDENT[key][node == len(nodes) - 1]
            found = values + places @ gradients.T
            np.testing.assert_allclose(found[:, np.argsort(found[0])], expected[:, np.argsort(expected[0])], atol=1e-13)


@every
def test_columns_do_not_depend_on_where_the_node_is(random: np.random.Generator, key: str) -> None:
    for nodes in perturbed(random, key, 5):
        for node in range(len(nodes)):
            moved = nodes.copy()
            moved[node] = 1e9
            before, after = (kernels.coefficient_columns(p, CODES[key], node) for p in (nodes, moved))
            np.testing.assert_array_equal(before[0], after[0])
            np.testing.assert_array_equal(before[1], after[1])


@every
def test_measure_is_the_integral_of_the_jacobian(random: np.random.Generator, key: str) -> None:
    nodes = perturbed(random, key, 50)
    at, weights = quadrature(key)
    assert weights.sum() == pytest.approx({"triangle": 1 / 2, "wedge": 1 / 2, "tetra": 1 / 6}.get(key, 1))
    np.testing.assert_allclose(judged(nodes, key)[1], jacobians(key, nodes, at) @ weights, atol=1e-13)
