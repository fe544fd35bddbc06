"""Vertices that come back towards the input."""

from __future__ import annotations

import numpy as np
from meshes import relocate, tangle

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve.strategies import Move


def test_vertices_come_back_as_far_as_the_mesh_stays_valid(mesh: Mesh) -> None:
    """Where all of the way is valid, to the very bits; else nearer, and no determinant is below the floor."""
    near = mesh.with_points(tangle(mesh, 100, 1e-3).points)
    assert near.check()[0] == 0
    points = mesh.points.copy()
    for blocks in mesh.topology.colours:
        relocate(near, Move.COME_BACK, points, blocks)
    assert points.tobytes() == near.points.tobytes()
    tangled, points, moved = tangle(mesh, 25, 0.6), mesh.points.copy(), 0
    assert tangled.check()[0] > 0
    for _ in range(3):
        before = np.linalg.norm(points - tangled.points, axis=1)
        for blocks in mesh.topology.colours:
            relocate(tangled, Move.COME_BACK, points, blocks)
        after = np.linalg.norm(points - tangled.points, axis=1)
        assert (after <= before * (1 + 1e-12)).all()
        moved += int((after < before).sum())
        assert mesh.with_points(points.copy()).check()[0] == 0
    assert moved > 10
