"""Passes over the whole mesh, each beside what it is by definition, simplex by simplex."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import tangle
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.topology import distinct, rows_of
from meshfix_cli.quality.summary import summarise


def two_of(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Points and simplices of a mesh and a copy of it beside it, which is three times as large."""
    far = 10 * np.ptp(mesh.points)
    simplices = np.concatenate([mesh.topology.simplices, mesh.topology.simplices + mesh.topology.n])
    return np.concatenate([mesh.points, 3 * mesh.points + far]), simplices.astype(np.int32)


def determinants(points: NDArray[np.float64], simplices: NDArray[np.int32]) -> NDArray[np.float64]:
    corners = points[simplices]
    return np.linalg.det(corners[:, 1:] - corners[:, :1])


def test_sizes_of_components_do_not_depend_on_inner_vertices(mesh: Mesh, random: np.random.Generator) -> None:
    points, simplices = two_of(mesh)
    turned = random.random(len(simplices)) < 0.5
    simplices[turned, :2] = simplices[turned, 1::-1]
    found = kernels.Connectivity(points, simplices, np.arange(len(points), dtype=np.int32), 1)
    signed = determinants(points, found.vertices[found.simplices]) * np.where(found.against, -1, 1)
    sizes = found.signed_sizes(points)
    np.testing.assert_allclose(sizes, np.bincount(found.component, weights=signed), rtol=1e-9)
    points[np.concatenate([~mesh.topology.boundary] * 2)] += 1e9
    assert found.signed_sizes(points).tobytes() == sizes.tobytes()


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_summary_is_that_of_the_angles_and_determinants(mesh: Mesh, share: float) -> None:
    tangled = tangle(mesh, 100 * share, 1.5) if share else mesh
    simplices, d = tangled.topology.simplices, tangled.dimension
    summary = summarise(tangled)
    smallest, largest = np.degrees(kernels.angles(tangled.points, simplices, 1))
    measure, valid = kernels.measure(tangled.points, simplices, 1)
    assert (summary.min_angle, summary.max_angle) == (smallest.min(), largest.max())
    assert summary.mean_min_angle == pytest.approx(smallest.mean())
    assert summary.percentile_1 == pytest.approx(np.percentile(smallest, 1))
    assert sum(summary.histogram) == len(simplices)
    assert summary.inverted_elements.tolist() == np.flatnonzero(valid == 0).tolist()
    assert summary.min_measure == measure.min() == tangled.check()[1]
    assert tangled.check()[0] == summary.inverted == (valid == 0).sum()
    own = tangled.topology.connectivity
    sign = np.sign(measure)[own.rows]
    across = np.where(own.mates < 0, 0, sign[own.mates // (d + 1)])
    assert summary.folded == (sign[:, None] * across < 0).sum() / 2
    assert (summary.inverted > 0) == (share > 0)


def test_rows_and_distinct_values_are_those_of_numpy(random: np.random.Generator) -> None:
    which = random.integers(0, 50, 200).astype(np.int32)
    for values in (random.random((50, 3)), random.random((50, 2)), random.random((50, 3)).T.copy().T, which < 9):
        assert rows_of(values, which % len(values)).tobytes() == np.take(values, which % len(values), axis=0).tobytes()
    for numbers in (which, which.reshape(-1, 4), which[:0]):
        assert distinct(numbers).tolist() == np.unique(numbers).tolist()
