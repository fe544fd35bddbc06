"""Points of the boundary that lie at one place with others: they may be in contact, or a tangle has put them there."""

from __future__ import annotations

import generate
import meshio
import numpy as np
from numpy.typing import NDArray

from meshfix_cli import Mesh, untangle


def given(points: NDArray[np.float64], cells: NDArray[np.integer]) -> meshio.Mesh:
    return meshio.Mesh(np.column_stack([points, np.zeros(len(points))]), [("triangle", cells)])


def test_a_tangle_makes_no_twins_where_a_reference_tells_them_apart() -> None:
    points, cells = generate.plate(0.25)
    straight = np.flatnonzero(points[:, 1] == points[:, 1].min())
    row = straight[np.argsort(points[straight, 0])]
    moved = points.copy()
    moved[row[3]] = points[row[5]]
    tangled = given(moved, cells)
    assert not untangle(tangled, slide="flat").valid
    assert untangle(tangled, slide="flat", reference=given(points, cells)).valid


def test_twins_of_both_meshes_stay() -> None:
    """Two plates that touch along a side, of which no point is of both."""
    points, cells = generate.plate(0.25)
    right = points[:, 0].max()
    both = np.vstack([points, points * [-1, 1] + [2 * right, 0]])
    every = np.vstack([cells, cells[:, ::-1] + len(points)])
    mesh = Mesh.build(both, every)
    touching = np.flatnonzero(both[:, 0] == right)
    assert len(touching) > 4
    moved = both + np.where(mesh.movable[:, None], np.random.default_rng(0).normal(0, 0.1, both.shape), 0.0)
    result = untangle(given(moved, every), slide="flat", reference=given(both, every))
    assert result.valid
    assert not result.after.movable[touching].any()
    assert result.after.movable[mesh.topology.boundary].any()
