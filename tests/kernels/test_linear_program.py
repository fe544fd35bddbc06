"""The linear programme of section 2 against HiGHS and against its own dual."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from meshes import random_star, star_of, tangle
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import block_diag

from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh

OPTIMAL, DEGENERATE = 0, 1
Star = tuple[NDArray[np.float64], NDArray[np.uint16]]


Array = NDArray[np.float64]


def programme(
    points: Array, faces: NDArray[np.uint16], heights: bool = False
) -> tuple[Array, Array, float, NDArray[np.bool_]]:
    """Gradients (k, d) and values (k,) at the origin of the determinants or heights, the box, the faces (n,) kept."""
    corners = points[faces]
    values = np.linalg.det(corners)
    if points.shape[1] == 2:
        edge = corners[:, 1] - corners[:, 0]
        gradients = np.stack([-edge[:, 1], edge[:, 0]], axis=1)
    else:
        gradients = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(gradients, axis=1)
    kept = sizes > 1e-12 * sizes.max()
    gradients, values = gradients[kept], values[kept]
    if heights:
        gradients, values = gradients / sizes[kept, None], values / sizes[kept]
    return gradients, values, np.linalg.norm(points, axis=1).max(), kept


def highs(stars: list[tuple[Star, Array]], heights: bool) -> Array:
    """Maximise t subject to t <= c_i + n_i . x in the box along the axes of the frame; many stars in one programme."""
    blocks, right, sides, places = [], [], [], []
    for star, frame in stars:
        gradients, values, box, _ = programme(*star, heights)
        blocks.append(np.hstack([-gradients @ frame.T, np.ones((len(values), 1))]))
        right.append(values)
        sides += [(-box, box)] * len(frame) + [(-np.inf, np.inf)]
        places.append(len(sides) - 1)
    cost = np.zeros(len(sides))
    cost[places] = -1
    result = linprog(
        cost, block_diag(blocks, format="csr"), np.concatenate(right), bounds=sides, method="highs",
        options={"presolve": False, "primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )  # fmt: skip
    assert result.status == 0
    return np.asarray(result.x[places])


def assert_certificate(star: Star, pi: Array, weights: Array, frame: Array, heights: bool) -> None:
    """Primal and dual feasible with the same value: optimal, whoever found it."""
    gradients, values, box, kept = programme(*star, heights)
    d, n = len(frame), len(star[1])
    x, t, scale = pi[:d], pi[d], np.abs(values).max() + box
    np.testing.assert_allclose(frame @ frame.T, np.eye(d), atol=1e-12)
    y, sides = weights[:n], weights[n:].reshape(d, 2)
    assert (values + gradients @ x - t).min() >= -1e-11 * scale
    assert np.abs(frame @ x).max() <= box * (1 + 1e-11)
    assert weights.min() >= -1e-11
    assert y.sum() == pytest.approx(1, abs=1e-10)
    assert not y[~kept].any()
    np.testing.assert_allclose(y[kept] @ gradients @ frame.T, sides[:, 0] - sides[:, 1], atol=1e-9 * max(1, scale))
    assert y[kept] @ values + box * sides.sum() == pytest.approx(t, abs=1e-10 * scale)


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


@pytest.mark.parametrize("heights", [False, True])
def test_every_success_carries_a_certificate(
    random: np.random.Generator, bracket: Mesh, plate: Mesh, heights: bool
) -> None:
    count = 0
    statuses: dict[str, set[int]] = {}
    for kind, star in stars(random, bracket, plate):
        count += 1
        status, pi, weights, frame, pivots = kernels.linear_program(*star, heights)
        statuses.setdefault(kind, set()).add(status)
        if status == DEGENERATE:
            singular = np.linalg.svd(programme(*star)[0], compute_uv=False)
            assert len(singular) < star[0].shape[1] or singular[-1] <= 1e-8 * singular[0]
            continue
        assert status == OPTIMAL
        assert pivots < 100
        assert_certificate(star, pi, weights, frame, heights)
    assert count == 5000
    assert statuses["flat"] == {DEGENERATE} == statuses["collapsed"]
    assert statuses["random"] == {OPTIMAL} == statuses["interior"]


@pytest.mark.parametrize("heights", [False, True])
def test_against_highs(random: np.random.Generator, bracket: Mesh, plate: Mesh, heights: bool) -> None:
    solved: list[tuple[Star, Array]] = []
    reached = []
    for _, star in stars(random, bracket, plate):
        status, pi, _, frame, _ = kernels.linear_program(*star, heights)
        if status == OPTIMAL:
            solved.append((star, frame))
            reached.append(pi[-1])
    assert len(solved) > 4500
    scales = [np.abs(programme(*star, heights)[1]).max() for star, _ in solved]
    expected = np.concatenate([highs(solved[i : i + 40], heights) for i in range(0, len(solved), 40)])
    assert (np.abs(reached - expected) <= 1e-9 * np.maximum(np.abs(expected), scales)).all()


@pytest.mark.parametrize("d", [2, 3])
def test_regular_star_has_its_optimum_in_the_centre(d: int) -> None:
    points = np.concatenate([np.eye(d), -np.eye(d)])
    faces = []
    for signs in np.ndindex(*(2,) * d):
        face = [axis + d * sign for axis, sign in enumerate(signs)]
        faces.append(face if np.linalg.det(points[face]) > 0 else [face[1], face[0], *face[2:]])
    status, pi, *_ = kernels.linear_program(points, np.array(faces, dtype=np.uint16), False)
    assert status == OPTIMAL
    np.testing.assert_allclose(pi, [0.0] * d + [1.0], atol=1e-14)


def test_a_star_of_one_tetrahedron_ends_on_the_box() -> None:
    points = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    star = points, np.array([[0, 1, 2]], dtype=np.uint16)
    status, pi, *_ = kernels.linear_program(*star, False)
    assert status == DEGENERATE  # one normal does not span space
    assert np.linalg.norm(pi[:3]) <= np.sqrt(3)


@pytest.mark.parametrize("d", [2, 3])
def test_theorem_2_1_minimum_measure_is_concave(random: np.random.Generator, d: int) -> None:
    for _ in range(200):
        points, faces = random_star(random, d, spread=1.0)
        gradients, values, *_ = programme(points, faces)
        a, b = random.uniform(-2, 2, (2, d))
        weight = random.uniform()
        f = [(values + gradients @ x).min() for x in (a, b, weight * a + (1 - weight) * b)]
        assert f[2] >= weight * f[0] + (1 - weight) * f[1] - 1e-12
