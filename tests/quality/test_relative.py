"""Mean ratios to a reference, of elements of every type."""

from __future__ import annotations

import numpy as np
import pytest
from isoparametric import Array, regular, smallest_jacobian
from verdict import vtk_quality

from meshfix_cli.mesh.elements import ELEMENTS, JUDGED
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.reference import reference_points
from meshfix_cli.quality.relative import worst_and_mean_to

every = pytest.mark.parametrize("key", [element.key for element in JUDGED])


def element(key: str, nodes: Array) -> Mesh:
    return Mesh.build(nodes, [(key, np.arange(len(nodes))[None])])


def ratio(key: str, nodes: Array, reference: Array) -> tuple[float, float]:
    there = element(key, reference)
    return worst_and_mean_to(there.with_points(nodes), reference_points(there, there))


@every
def test_an_affine_map_has_its_own_mean_ratio_at_every_corner(random: np.random.Generator, key: str) -> None:
    nodes = regular(key)
    d = nodes.shape[1]
    reference = nodes + 0.05 * random.standard_normal(nodes.shape)
    for _ in range(10):
        linear = np.eye(d) + 0.3 * random.standard_normal((d, d))
        expected = d * max(np.linalg.det(linear), 0.0) ** (2 / d) / (linear**2).sum()
        assert ratio(key, reference @ linear.T + 5.0, reference) == pytest.approx((expected, expected), rel=1e-10)


@pytest.mark.parametrize("key", ["triangle", "quad", "tetra", "hexahedron"])
def test_the_ratio_to_an_ideal_element_is_the_shape_of_verdict(random: np.random.Generator, key: str) -> None:
    nodes = regular(key)
    moved = nodes + 0.15 * random.standard_normal((20, *nodes.shape))
    for here, expected in zip(moved, vtk_quality("shape", ELEMENTS[key], moved), strict=True):
        assert ratio(key, here, nodes) == pytest.approx((expected, expected), rel=1e-6)


def test_an_element_that_is_inverted_inside_alone_has_none() -> None:
    """Its top is turned half round against its bottom, each squeezed another way: the corners are all well."""
    nodes = regular("hexahedron") - 0.5
    nodes[:4] *= [2.0**0.5, 0.5**0.5, 1]
    nodes[4:] *= [-(0.5**0.5), -(2.0**0.5), 1]
    cube = regular("hexahedron")
    corners = [nodes[list(row[1:])] - nodes[row[0]] for row in ELEMENTS["hexahedron"].shape.simplices]
    assert np.linalg.det(corners).min() > 0.1
    assert smallest_jacobian("hexahedron", nodes) < 0
    two = np.concatenate([cube, nodes + 3.0])
    rows = np.arange(16).reshape(2, 8)
    reference = Mesh.build(np.concatenate([cube, cube + 3.0]), [("hexahedron", rows)])
    moved = reference.with_points(two)
    assert worst_and_mean_to(moved, reference_points(moved, reference)) == pytest.approx((0.0, 0.5))
