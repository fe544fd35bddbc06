"""Passes over vectors, sides and corners of surfaces give what plain formulas do."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from meshfix_cli import kernels

Int32 = NDArray[np.int32]


def some_facets(random: np.random.Generator, width: int, n: int = 40, count: int = 60) -> Int32:
    """Facets of three or, where there is room, of four different vertices; many meet at an edge."""
    facets = np.array([random.permutation(n)[:width] for _ in range(count)], dtype=np.int32)
    if width == 4:
        facets[::3, 3] = -1
    return facets


def corners_of(facets: Int32) -> list[list[int]]:
    """The vertices of each facet."""
    return [[v for v in row if v >= 0] for row in facets.tolist()]


@pytest.mark.parametrize("d", [2, 3])
def test_vectors_have_the_length_one_or_none(d: int) -> None:
    random = np.random.default_rng(d)
    vectors = random.standard_normal((50, d)) * 10.0 ** random.integers(-9, 9, (50, 1))
    vectors[7] = 0.0
    found = kernels.unit_vectors(vectors)
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    assert np.array_equal(found, np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))


@pytest.mark.parametrize("d", [2, 3])
def test_sums_products_and_sines_are_those_of_numpy(d: int) -> None:
    random = np.random.default_rng(d)
    vectors, group = random.standard_normal((30, d)), random.integers(0, 9, 80).astype(np.int32)
    rows = random.integers(0, 30, 80).astype(np.int32)
    sums = np.stack([np.bincount(group, column, 9) for column in vectors[rows].T], axis=1)
    assert np.array_equal(kernels.summed(group, vectors, 9, rows), sums)
    assert np.array_equal(kernels.summed(group, np.ascontiguousarray(vectors[rows]), 9), sums)
    pairs = random.integers(0, 30, (40, 2)).astype(np.int32)
    vectors[3] = 0.0
    one, other = vectors[pairs[:, 0]], vectors[pairs[:, 1]]
    products = (one * other).sum(axis=1)
    assert np.array_equal(kernels.dots_between(vectors, pairs), products)
    lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    square = np.maximum(lengths**2 - products**2, 0.0)
    sines = np.sqrt(np.divide(square, lengths**2, out=np.zeros(40), where=lengths > 0))
    assert kernels.sines_between(vectors, pairs) == pytest.approx(sines, abs=1e-7)


def test_numbers_are_counted_in_a_stable_order() -> None:
    numbers = np.random.default_rng(1).integers(0, 12, 100).astype(np.int32)
    order, offsets = kernels.counted_order(numbers, 14)
    assert np.array_equal(order, np.argsort(numbers, kind="stable"))
    assert np.array_equal(np.diff(offsets), np.bincount(numbers, minlength=14))


@pytest.mark.parametrize("width", [3, 4])
def test_edges_know_their_sides_and_lines(width: int) -> None:
    random = np.random.default_rng(width)
    facets = some_facets(random, width)
    lines = np.array([[5, 2], [facets[0, 1], facets[0, 0]], [2, 5]], dtype=np.int32)
    ends, owners, edges, order, count, is_line = kernels.joints(facets, lines, 40)
    corners = [(f, v) for f, row in enumerate(corners_of(facets)) for v in row]
    sides: dict[tuple[int, int], list[int]] = {}
    k = 0
    for f, row in enumerate(corners_of(facets)):
        for a, b in zip(row, [*row[1:], row[0]], strict=True):
            assert owners[k] == f
            assert [corners[corner] for corner in ends[k]] == [(f, min(a, b)), (f, max(a, b))]
            sides.setdefault((min(a, b), max(a, b)), []).append(k)
            k += 1
    of_lines = {(min(a, b), max(a, b)) for a, b in lines.tolist()}
    every = sorted({*sides, *of_lines})
    assert [tuple(edge) for edge in edges.tolist()] == every
    assert count.tolist() == [len(sides.get(edge, ())) for edge in every]
    assert is_line.astype(bool).tolist() == [edge in of_lines for edge in every]
    assert order.tolist() == [side for edge in every for side in sides.get(edge, ())]


@pytest.mark.parametrize("width", [3, 4])
def test_normals_of_fans_are_weighted_by_angles(width: int) -> None:
    random = np.random.default_rng(width)
    facets, points = some_facets(random, width), random.standard_normal((40, 3))
    normals = kernels.unit_vectors(random.standard_normal((len(facets), 3)))
    vertices = np.concatenate(corners_of(facets)).astype(int)
    fan = np.unique(vertices, return_index=True)[1][np.unique(vertices, return_inverse=True)[1]].astype(np.int32)
    sums, corner = np.zeros((len(vertices), 3)), 0
    for f, row in enumerate(corners_of(facets)):
        for i, v in enumerate(row):
            a, b = points[row[(i + 1) % len(row)]] - points[v], points[row[i - 1]] - points[v]
            angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
            sums[fan[corner]] += angle * normals[f]
            corner += 1
    expected = np.zeros_like(sums)
    some = np.linalg.norm(sums, axis=1) > 0
    expected[some] = sums[some] / np.linalg.norm(sums[some], axis=1, keepdims=True)
    assert kernels.fan_normals(points, facets, normals, fan) == pytest.approx(expected, abs=1e-12)


def test_what_is_around_vertices_names_the_other_corners_and_the_piece() -> None:
    random = np.random.default_rng(3)
    triangles = some_facets(random, 3, 20, 30)
    segments = np.array([random.permutation(20)[:2] for _ in range(10)], dtype=np.int32)
    shape = random.integers(-1, 3, 40).astype(np.int32)
    place = random.permutation(40).astype(np.int32)
    bounded = random.random(20) < 0.7
    offsets, rows = kernels.around_pieces(triangles, segments, shape, place, bounded)
    found = [sorted(map(tuple, rows[a:b].tolist())) for a, b in pairwise(offsets)]
    expected: list[list[tuple[int, ...]]] = [[] for _ in range(20)]
    for piece, corners in enumerate([*triangles.tolist(), *segments.tolist()]):
        for i, v in enumerate(corners):
            if bounded[v] and shape[piece] >= 0:
                others = (*corners[i + 1 :], *corners[:i])
                filled = (*others, -1) if len(corners) == 2 else others
                expected[v].append((*filled, int(shape[piece]), int(place[piece])))
    assert found == [sorted(some) for some in expected]


@pytest.mark.parametrize("count", [1, 7, 3000])
def test_triangles_are_checked_as_where_they_are_unfolded(count: int) -> None:
    random = np.random.default_rng(count)
    points = random.standard_normal((50, 3))
    nodes = np.array([random.permutation(50)[:3] for _ in range(count)], dtype=np.int32)
    offsets = np.arange(0, 3 * count + 1, 3, dtype=np.int32)
    normals = kernels.unit_vectors(random.standard_normal((count, 3)))
    flat = kernels.unfold(points, offsets, nodes.ravel(), normals, 1)
    areas = kernels.area_vectors(points, offsets, nodes.ravel(), 1)
    size = np.linalg.norm(areas, axis=1)
    signed = np.where((areas * normals).sum(axis=1) < 0, -size, size)
    a, b = flat.reshape(-1, 3, 2)[:, 1], flat.reshape(-1, 3, 2)[:, 2]
    assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2 == pytest.approx(signed, rel=1e-9)
    alone = kernels.check_unfolded(points, offsets, nodes.ravel(), normals, 1)
    for threads in (1, 2):
        inverted, smallest = kernels.check_unfolded(points, offsets, nodes.ravel(), normals, threads)
        apart = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
        expected = kernels.check(flat, apart, 1)
        assert np.array_equal(inverted, expected[0])
        assert smallest == pytest.approx(expected[1], rel=1e-9)
        assert smallest == alone[1]
        assert np.array_equal(inverted, np.flatnonzero(signed < 0))
