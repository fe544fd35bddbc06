"""What edges between held vertices allow: the sine of the angle between two of them, at a corner that is theirs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from meshfix_cli import Mesh, untangle
from meshfix_cli.quality.summary import ceiling, summarise


def sheared(dimension: int, angle: float) -> Mesh:
    """A block of quadrilaterals or hexahedra whose sides lean by an angle, in degrees."""
    number = np.arange(4**dimension).reshape((4,) * dimension)
    points = np.moveaxis(np.indices(number.shape), 0, -1).reshape(-1, dimension).astype(float)
    points[:, 0] += math.tan(math.radians(angle)) * points[:, 1]
    ring = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    if dimension == 3:
        ring = [one[..., side] for side in (slice(-1), slice(1, None)) for one in ring]
    cells = np.stack([one.ravel() for one in ring], axis=1)
    return Mesh.build(points, [("quad" if dimension == 2 else "hexahedron", cells)])


@pytest.mark.parametrize("dimension", [2, 3])
def test_it_is_the_sine_at_the_corners_of_a_block(dimension: int) -> None:
    for angle in (20, 50):
        mesh = sheared(dimension, angle)
        most = ceiling(mesh)
        assert most == pytest.approx(math.cos(math.radians(angle)), abs=1e-12)
        best = untangle(mesh, smooth="best").after
        assert most is not None
        assert summarise(best).smallest <= most * (1 + 1e-12)
    assert ceiling(sheared(dimension, 0)) is None
