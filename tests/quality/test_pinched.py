"""Faces that their fixed nodes pinch, against a search that knows nothing of the proof."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bent import mesh_of, straight
from monomials import CODES, HIGHER, Array, derivatives, perturbed, positions, type_of
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter
from scipy.optimize import least_squares

from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.quadratic import Quadratic
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.quality.pinched import pinched
from meshfix_cli.repair import Method

SOLID = [key for key in (*CODES, *HIGHER) if type_of(key).shape.dimension == 3]


def one(key: str) -> Quadratic:
    count = type_of(key).nodes
    return Quadratic([(key, np.arange(count)[None])], count)


def free_beside(key: str, facet: tuple[int, ...]) -> NDArray[np.bool_]:
    """Mark the nodes (n,) that are not in a face."""
    element = type_of(key)
    weights = np.concatenate([np.eye(element.shape.corners), element.weights])
    return np.asarray(weights[:, list(facet)].sum(axis=1) < 1 - 1e-9)


def found_pinched(key: str, nodes: Array, facet: tuple[int, ...]) -> bool:
    """Search a face for a place where the cross product of the derivatives along it is zero."""
    corners = positions(key)[list(facet)]
    ways = corners[[1, -1]] - corners[0]  # the parameters of all faces are triangles and parallelograms

    def normals(at: Array) -> Array:
        first, second = np.moveaxis(ways @ derivatives(key, nodes, corners[0] + at @ ways), 1, 0)
        return np.cross(first, second)

    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 81)] * 2), axis=-1)
    length = np.linalg.norm(normals(grid.reshape(-1, 2)), axis=1).reshape(81, 81)
    for start in grid[length == minimum_filter(length, 3)]:
        end = least_squares(lambda at: normals(at[None])[0], start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        inside = end.x.min() > 0 and (end.x.max() < 1 if len(corners) == 4 else end.x.sum() < 1)
        if inside and np.abs(end.fun).max() < 1e-10:
            return True
    return False


@pytest.mark.parametrize("key", SOLID)
def test_faces_are_pinched_where_a_search_finds_such_a_place(random: np.random.Generator, key: str) -> None:
    mesh, seen = one(key), set()
    asked = np.ones(1, dtype=bool)
    for _ in range(10):
        nodes = perturbed(random, key, random.choice([0.05, 0.15, 0.3]))
        facet = type_of(key).shape.facets[random.integers(len(type_of(key).shape.facets))]
        free = free_beside(key, facet)
        marked = bool(pinched(mesh, nodes, free, asked)[0])
        assert marked == found_pinched(key, nodes, facet)
        seen.add(marked)
        if marked:
            for size in (0.1, 1.0, 10.0):
                moved = nodes + size * random.normal(size=nodes.shape) * free[:, None]
                assert mesh.judge(moved, 1).verdicts[0] != VALID
    assert seen == {False, True}


def umbrella(corners: Array) -> Array:
    """Return the middles (3, 3) of the edges of a face (s s, s t, t) with these corners, pinched where s = t = 0."""
    s, t = (np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]]) - 1 / 3).T
    own = np.stack([s * s, s * t, t], axis=1)
    ways = np.array([*(own[1:3] - own[0]), [0.3, 0, 0]])
    there = np.array([*(corners[1:] - corners[0]), np.cross(*(corners[1:] - corners[0]))])
    return np.asarray(corners[0] + (own[3:] - own[0]) @ np.linalg.inv(ways) @ there)


def test_an_element_with_a_pinched_face_is_named_and_does_not_hold_up_others() -> None:
    """The proofs of the kernels, at places of a lattice, do not tell it."""
    points, rows = straight("tetra10")
    element, outer = type_of("tetra10"), ((points == 0) | (points == 1)).any(axis=1)
    row, place = np.argwhere((points[rows[:, :4], 0] > 0).sum(axis=1, keepdims=True) * ~outer[rows[:, :4]] == 1)[0]
    facet = list(element.shape.facets[place])  # opposite the only corner that is off the plane x = 0
    shares = np.array(element.weights)[:, facet]
    edges = [4 + int(np.argmax(shares[:, [i, (i + 1) % 3]].min(axis=1))) for i in range(3)]
    points[rows[row, edges]] = umbrella(points[rows[row, facet]])
    mesh = mesh_of(Quadratic([("tetra10", rows)], len(points)), points, "tetra10", rows, ~outer)
    assert mesh.quadratic is not None
    assert not mesh.quadratic.kernel.impossible(points, (~outer).astype(np.uint8))[row]
    assert row in find_obstacles(mesh).inverted
    outcome = Method(smooth=0).solve(mesh, math.inf, 1)
    assert outcome.obstacles.inverted.tolist() == [row]
    assert np.flatnonzero(outcome.after.judge_curved()[0]).tolist() == [row]
