"""The linear programme of section 2 against HiGHS and against its own dual."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from conftest import random_star, star_of, tangle
from numpy.typing import NDArray
from scipy.optimize import linprog

from meshfix_cli import _kernels
from meshfix_cli.mesh import Mesh

OPTIMAL, DEGENERATE = 0, 1
Star = tuple[NDArray[np.float64], NDArray[np.uint16]]


def programme(points: NDArray[np.float64], faces: NDArray[np.uint16]) -> tuple[NDArray[np.float64], ...]:
    """Gradients (n, d) and values (n,) at the origin of the determinants, and the box."""
    corners = points[faces]
    values = np.linalg.det(corners)
    if points.shape[1] == 2:
        edge = corners[:, 1] - corners[:, 0]
        gradients = np.stack([-edge[:, 1], edge[:, 0]], axis=1)
    else:
        gradients = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return gradients, values, np.abs(points).max()


def highs(points: NDArray[np.float64], faces: NDArray[np.uint16]) -> float:
    """Maximise t subject to t <= c_i + n_i . x in the box."""
    gradients, values, box = programme(points, faces)
    d = points.shape[1]
    kept = np.linalg.norm(gradients, axis=1) > 1e-12 * np.linalg.norm(gradients, axis=1).max()
    matrix = np.hstack([-gradients, np.ones((len(values), 1))])[kept]
    result = linprog(
        [0] * d + [-1], matrix, values[kept], bounds=[(-box, box)] * d + [(None, None)], method="highs",
        options={"presolve": False, "primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )  # fmt: skip
    assert result.status == 0
    return float(-result.fun)


def assert_certificate(star: Star, pi: NDArray[np.float64], weights: NDArray[np.float64]) -> None:
    """Primal and dual feasible with the same value: optimal, whoever found it."""
    points, faces = star
    gradients, values, box = programme(points, faces)
    d, n = points.shape[1], len(faces)
    x, t, scale = pi[:d], pi[d], np.abs(values).max() + box
    y, sides = weights[:n], weights[n:].reshape(d, 2)
    sizes = np.linalg.norm(gradients, axis=1)
    kept = sizes > 1e-12 * sizes.max()
    assert (values + gradients @ x - t)[kept].min() >= -1e-11 * scale
    assert np.abs(x).max() <= box * (1 + 1e-11)
    assert weights.min() >= -1e-11
    assert y.sum() == pytest.approx(1, abs=1e-10)
    np.testing.assert_allclose(y @ gradients, sides[:, 0] - sides[:, 1], atol=1e-9 * max(1, scale))
    assert y @ values + box * sides.sum() == pytest.approx(t, abs=1e-10 * scale)


def stars(random: np.random.Generator, bracket: Mesh, plate: Mesh) -> Iterator[tuple[str, Star]]:
    """5,000 stars: random and real, well shaped and not."""
    for i in range(600):
        for d in (2, 3):
            points, faces = random_star(random, d, spread=(0.1, 0.3, 1.0)[i % 3])
            yield "random", (points, faces)
            yield "open", (points, faces[: max(1, len(faces) // 2)])
            together = points.copy()
            together[faces[0][0]] = together[faces[0][1]]
            yield "co-located", (together, faces)
    for i in range(100):
        d = 2 + i % 2
        points, faces = random_star(random, d)
        flat = points.copy()
        flat[:, -1] = 0.0
        yield "flat", (flat, faces)
        yield "collapsed", (np.zeros_like(points), faces)
    meshes = [mesh for base in (bracket, plate) for mesh in (base, tangle(base), tangle(base, 100, 8))]
    for i in range(1200):
        mesh = meshes[i % len(meshes)]
        vertex = int(random.choice(np.flatnonzero(mesh.topology.used)))
        yield "interior" if mesh.movable[vertex] else "boundary", star_of(mesh, vertex)


def test_every_success_carries_a_certificate(random: np.random.Generator, bracket: Mesh, plate: Mesh) -> None:
    count = 0
    statuses: dict[str, set[int]] = {}
    for kind, star in stars(random, bracket, plate):
        count += 1
        status, pi, weights, pivots = _kernels.linear_program(*star)
        statuses.setdefault(kind, set()).add(status)
        if status == DEGENERATE:
            singular = np.linalg.svd(programme(*star)[0], compute_uv=False)
            assert len(singular) < star[0].shape[1] or singular[-1] <= 1e-8 * singular[0]
            continue
        assert status == OPTIMAL
        assert pivots < 100
        assert_certificate(star, pi, weights)
    assert count == 5000
    assert statuses["flat"] == {DEGENERATE} == statuses["collapsed"]
    assert statuses["random"] == {OPTIMAL} == statuses["interior"]


def test_against_highs(random: np.random.Generator, bracket: Mesh, plate: Mesh) -> None:
    compared = 0
    for _, star in stars(random, bracket, plate):
        status, pi, _, _ = _kernels.linear_program(*star)
        if status == OPTIMAL:
            scale = np.abs(programme(*star)[1]).max()
            assert pi[-1] == pytest.approx(highs(*star), rel=1e-9, abs=1e-9 * scale)
            compared += 1
    assert compared > 4500


@pytest.mark.parametrize("d", [2, 3])
def test_regular_star_has_its_optimum_in_the_centre(d: int) -> None:
    points = np.concatenate([np.eye(d), -np.eye(d)])
    faces = []
    for signs in np.ndindex(*(2,) * d):
        face = [axis + d * sign for axis, sign in enumerate(signs)]
        faces.append(face if np.linalg.det(points[face]) > 0 else [face[1], face[0], *face[2:]])
    status, pi, _, _ = _kernels.linear_program(points, np.array(faces, dtype=np.uint16))
    assert status == OPTIMAL
    np.testing.assert_allclose(pi, [0.0] * d + [1.0], atol=1e-14)


def test_a_star_of_one_tetrahedron_ends_on_the_box() -> None:
    points = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    star = points, np.array([[0, 1, 2]], dtype=np.uint16)
    status, pi, _, _ = _kernels.linear_program(*star)
    assert status == DEGENERATE  # one normal does not span space
    assert np.abs(pi[:3]).max() <= 1.0


@pytest.mark.parametrize("d", [2, 3])
def test_theorem_2_1_minimum_measure_is_concave(random: np.random.Generator, d: int) -> None:
    for _ in range(200):
        points, faces = random_star(random, d, spread=1.0)
        gradients, values, _ = programme(points, faces)
        a, b = random.uniform(-2, 2, (2, d))
        weight = random.uniform()
        f = [(values + gradients @ x).min() for x in (a, b, weight * a + (1 - weight) * b)]
        assert f[2] >= weight * f[0] + (1 - weight) * f[1] - 1e-12
