"""The plane of a mesh in space, also where a vertex has been thrown far away."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from meshfix_cli import read
from meshfix_cli.errors import MeshfixError
from meshfix_cli.meshfile.plane import plane_basis


def in_space(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points of a unit square in an oblique plane, and the normal of this."""
    axes = np.linalg.qr(random.standard_normal((3, 3)))[0]
    return np.array([3.0, -2.0, 5.0]) + random.random((200, 2)) @ axes[:2], axes[2]


@pytest.mark.parametrize("far", [0.0, 1e2, 1e4, 1e6, 1e9])
def test_a_vertex_far_away_in_the_plane_does_not_tilt_it(far: float, random: np.random.Generator) -> None:
    for _ in range(20):
        points, normal = in_space(random)
        points[7] += far * (points[8] - points[9])
        basis = plane_basis(points)
        assert basis is not None
        np.testing.assert_allclose(basis @ basis.T, np.eye(2), atol=1e-14)
        assert np.abs(basis @ normal).max() < 1e-9


@pytest.mark.parametrize("far", [1e2, 1e4, 1e6, 1e9])
def test_what_is_not_flat_is_not_hidden_by_a_vertex_far_away(far: float, random: np.random.Generator) -> None:
    for bent in (False, True):
        points, normal = in_space(random)
        points[7] += far * (points[8] - points[9] if bent else normal)
        points[11] += 0.1 * normal * bent
        assert plane_basis(points) is None


def test_a_plane_along_the_axes_has_their_bits(random: np.random.Generator) -> None:
    points = np.column_stack([random.random((50, 2)), np.full(50, 0.1)])
    points[3, 0] = 1e7
    basis = plane_basis(points)
    assert basis is not None and basis.tolist() == [[1, 0, 0], [0, 1, 0]]


def test_coordinates_that_cannot_be_computed_with_are_refused_before_a_plane_is_looked_for(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1e200, 0, 1], [0, 1, 1e180], [-1e190, 2, 3]])
    rows = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    (tmp_path / "in.obj").write_text(f"{rows}f 1 2 3\nf 1 3 4\n")
    with pytest.raises(MeshfixError, match=r"coordinates beyond 1e\+45 cannot be computed with"):
        read(tmp_path / "in.obj")
