"""What makes a valid mesh impossible is found, and nothing else is."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from geometries import GEOMETRIES
from meshes import tangle
from numpy.typing import NDArray

from meshfix_cli import kernels, untangle
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.quality.summary import summarise

Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]


@pytest.mark.parametrize("name", GEOMETRIES)
def test_nothing_is_found_in_a_valid_boundary(name: str) -> None:
    mesh = Mesh.build(*GEOMETRIES[name]())
    assert not find_obstacles(mesh)
    assert not find_obstacles(tangle(mesh, 100, 8))
    assert not find_obstacles(mesh.with_fixed(mesh.movable))


def strip(angle: float) -> Mesh:
    """A strip of triangles bent round in its plane by `angle`: beyond a whole turn it overlaps itself."""
    turn = np.linspace(0.0, angle, 80)
    rows = [np.column_stack([r * np.cos(turn), r * np.sin(turn)]) for r in (1.0, 1.2, 1.4)]
    cells = []
    for k in range(2):
        a = np.arange(79) + 80 * k
        cells += [np.column_stack([a, a + 80, a + 1]), np.column_stack([a + 1, a + 80, a + 81])]
    return Mesh.build(np.concatenate(rows), np.concatenate(cells))


def test_a_mesh_that_overlaps_itself_is_not_valid() -> None:
    """All of its triangles are positive: only the boundary tells."""
    assert untangle(strip(6.0)).valid
    mesh = strip(6.6)
    outcome = untangle(mesh)
    assert (summarise(mesh).inverted, summarise(mesh).folded) == (0, 0)
    assert not outcome.valid
    assert len(outcome.obstacles.crossing) >= 2
    first = mesh.points[mesh.topology.simplices[outcome.obstacles.crossing]].reshape(-1, 2)
    assert np.abs(np.arctan2(first[:, 1], first[:, 0])).max() < 0.6  # where the two ends meet


def test_a_hole_across_the_rim_is_named_in_2d_and_3d() -> None:
    for name in ("plate with holes", "box with pipes"):
        mesh = Mesh.build(*GEOMETRIES[name]())
        points = mesh.points.copy()
        hole = (np.linalg.norm(points[:, :2] - [0.8, 1.25], axis=1) < 0.36) & ~mesh.movable
        points[hole, 1] += 0.5
        moved = mesh.with_points(points)
        crossing = find_obstacles(moved).crossing
        assert len(crossing) > 0
        corners = points[moved.topology.simplices[crossing]]
        assert np.abs(corners[..., 1] - 2.0).min(axis=2).max() < 0.35  # near the rim y = 2


def test_slits_and_parts_in_contact_do_not_cross() -> None:
    """Two squares that share a side's positions, not its vertices; the second time they overlap by rounding."""
    square = np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)])
    cells = np.array([(0, 1, 2), (0, 2, 3)])
    for shift in (1.0, 1.0 - 1e-13):
        mesh = Mesh.build(np.concatenate([square, square + np.array([shift, 0.1])]), np.concatenate([cells, cells + 4]))
        assert not find_obstacles(mesh)


def test_a_slit_inside_one_part_does_not_cross() -> None:
    """A ring cut open along a line: both sides of the cut have the same positions."""
    mesh = strip(2 * np.pi)
    assert not find_obstacles(mesh)


def test_the_units_and_the_place_do_not_matter() -> None:
    mesh = strip(6.6)
    expected = find_obstacles(mesh).crossing.tolist()
    for scale, offset in ((1e-6, 0.0), (1e9, 0.0), (1.0, 1e4)):
        moved = Mesh.build(mesh.points * scale + offset, mesh.topology.simplices)
        assert find_obstacles(moved).crossing.tolist() == expected


def brute_force(points: NDArray[np.float64], facets: NDArray[np.int32]) -> set[tuple[int, int]]:
    """Solve for the point where a segment meets a line or a triangle."""
    found = set()
    d = points.shape[1]
    for a, b in combinations(range(len(facets)), 2):
        for one, other in ((a, b), (b, a)) if d == 3 else ((a, b),):
            for p, q in combinations(facets[one], 2):
                base, *rest = points[facets[other]]
                matrix = np.column_stack([points[q] - points[p], *(base - r for r in rest)])
                s, *t = np.linalg.solve(matrix, base - points[p])
                if 0 < s < 1 and min(t) > 0 and sum(t) < 1:
                    found.add((a, b))
    return found


@pytest.mark.parametrize("d", [2, 3])
def test_crossings_against_brute_force(random: np.random.Generator, d: int) -> None:
    for size, count in ((0.1, 60), (0.4, 60 if d == 3 else 25)):
        centres = random.uniform(size=(count, 1, d))
        points = (centres + random.normal(scale=size, size=(count, d, d))).reshape(-1, d)
        facets = np.arange(count * d, dtype=np.int32).reshape(count, d)
        pairs = [tuple(sorted(pair)) for pair in kernels.crossings(points, facets, 1).tolist()]
        assert len(pairs) == len(set(pairs)) > 5
        assert set(pairs) == brute_force(points, facets)
        assert kernels.crossings(points, facets, 3).tolist() == kernels.crossings(points, facets, 1).tolist()


def side(*corners: NDArray[np.int64]) -> int:
    """Sign of the determinant of d+1 places of a small lattice."""
    return int(np.sign(np.rint(np.linalg.det(np.array(corners[1:]) - corners[0]))))


def goes_through(segment: NDArray[np.int64], facet: NDArray[np.int64]) -> bool:
    """Whether a segment (2, d) meets the inside of a facet (d, d) between its ends."""
    p, q = segment
    if side(p, *facet) * side(q, *facet) >= 0:
        return False
    sides = {side(p, q, *np.delete(facet, k, axis=0)) * (-1) ** k for k in range(3)} if len(facet) == 3 else set()
    return (len(facet) == 2 and side(facet[0], p, q) * side(facet[1], p, q) < 0) or sides in ({1}, {-1})


@pytest.mark.parametrize("d", [2, 3])
def test_crossings_of_facets_that_touch(random: np.random.Generator, d: int) -> None:
    """On a small lattice many have corners, edges and planes in common, and boxes that only touch."""
    crossing = touching = 0
    for _ in range(4):
        corners = random.integers(0, 4, (25, d, d))
        facets = np.arange(25 * d, dtype=np.int32).reshape(25, d)
        expected = {
            (a, b)
            for (a, one), (b, other) in combinations(enumerate(corners), 2)
            if any(
                goes_through(x[list(edge)], y)
                for x, y in ((one, other), (other, one))
                for edge in combinations(range(d), 2)
            )
        }
        found = kernels.crossings(corners.reshape(-1, d).astype(float), facets, 1)
        assert {tuple(sorted(pair)) for pair in found.tolist()} == expected
        low, high = corners.min(axis=1), corners.max(axis=1)
        least = (np.minimum(high[:, None], high) - np.maximum(low[:, None], low)).min(axis=2)
        crossing, touching = crossing + len(expected), touching + int((least == 0).sum())
    assert crossing > 20
    assert touching > 20


def test_no_facets_no_crossings() -> None:
    assert kernels.crossings(np.zeros((3, 2)), np.zeros((0, 2), dtype=np.int32), 2).shape == (0, 2)


def disc(segments: int, radius: float, rings: int = 3) -> Arrays:
    """Points (n, 2) and triangles of a disc."""
    angle = 2 * np.pi * np.arange(segments) / segments
    points = [np.zeros((1, 2))]
    points += [radius * k / rings * np.column_stack([np.cos(angle), np.sin(angle)]) for k in range(1, rings + 1)]
    first, second = np.arange(segments), (np.arange(segments) + 1) % segments
    cells = [np.column_stack([np.zeros(segments, dtype=int), 1 + first, 1 + second])]
    return np.concatenate(points), np.concatenate([*cells, *_between(segments, rings - 1, 1)])


def ring(segments: int, inner: float, outer: float, rings: int = 3) -> Arrays:
    """Points (n, 2) and triangles of a disc with a hole, turned a little."""
    angle = 2 * np.pi * np.arange(segments) / segments + 0.1
    radii = np.linspace(inner, outer, rings + 1)
    points = [radius * np.column_stack([np.cos(angle), np.sin(angle)]) for radius in radii]
    return np.concatenate(points), np.concatenate(_between(segments, rings, 0))


def _between(segments: int, rings: int, start: int) -> list[NDArray[np.int64]]:
    first, second = np.arange(segments), (np.arange(segments) + 1) % segments
    cells = []
    for k in range(rings):
        a, b = start + k * segments + first, start + k * segments + second
        cells += [np.column_stack([a, a + segments, b]), np.column_stack([b, a + segments, b + segments])]
    return cells


def together(one: Arrays, other: Arrays, shift: tuple[float, float] = (0.0, 0.0)) -> Mesh:
    points = np.concatenate([one[0], other[0] + np.array(shift)])
    return Mesh.build(points, np.concatenate([one[1], other[1] + len(one[0])]))


@pytest.mark.parametrize(("segments", "others"), [(8, 8), (8, 64), (64, 8), (16, 200), (200, 9), (200, 200)])
def test_parts_that_overlap_and_parts_in_contact(segments: int, others: int) -> None:
    """A pin in a hole interpenetrates it by the height of a chord; a disc in a disc, or half of one, is too much."""
    assert not find_obstacles(together(disc(segments, 1), ring(others, 1, 2)))
    assert not find_obstacles(together(disc(segments, 0.3), ring(others, 1, 2)))
    nested = find_obstacles(together(disc(segments, 0.3), disc(others, 1)))
    assert len(nested.overlapping) > 0
    half = together(disc(segments, 1), disc(others, 1), (1.1, 0.2))
    found = [find_obstacles(half, threads).overlapping.tolist() for threads in (1, 2)]
    assert found[0] == found[1] != []
    assert not find_obstacles(replace(half, apart=True))
    assert not untangle(half).valid


def test_simplices_of_one_free_vertex_that_exclude_each_other(random: np.random.Generator) -> None:
    """Where HiGHS finds that the largest smallest determinant is not positive, and nowhere else, they are named."""
    from scipy.optimize import linprog

    named = 0
    for _ in range(200):
        count = int(random.integers(5, 9))
        angle = np.sort(random.uniform(0, 2 * np.pi, count))
        rim = np.column_stack([np.cos(angle), np.sin(angle)]) + random.normal(0, 0.35, (count, 2))
        cells = [(count, i, (i + 1) % count) for i in range(count)]
        mesh = Mesh.build(np.vstack([rim, [[0.0, 0.0]]]), cells)
        if mesh.topology.flipped.any():
            continue
        tangled = mesh.with_points(np.vstack([rim, [[3.0, 2.0]]]))
        a, b = rim, np.roll(rim, -1, axis=0)
        rows = np.column_stack([-(a[:, 1] - b[:, 1]), -(b[:, 0] - a[:, 0]), np.ones(count)])
        bounds_of = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        best = linprog([0, 0, -1], rows, bounds_of, bounds=[(None, None)] * 3)
        largest, found = -best.fun, find_obstacles(tangled).exclusive
        assert len(found) > 0 if largest < -1e-6 else len(found) == 0 or largest < 0
        assert (untangle(tangled).records[-1].inverted == 0) == (largest > 1e-12)  # some turn twice around it
        named += len(found) > 0
        if len(found):  # and these few already exclude each other
            few = linprog([0, 0, -1], rows[found], bounds_of[found], bounds=[(None, None)] * 3)
            assert few.fun > 0
    assert 10 < named < 190


def test_what_is_hopeless_excludes_nothing_else() -> None:
    """The first of four quadrilaterals is inverted at a fixed corner; beside it, the others can be valid."""
    points = np.array([[x, y] for y in range(3) for x in range(3)], dtype=float)
    points[0] = 1.5, 1.5
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    found = find_obstacles(Mesh.build(points, [("quad", quads)]))
    assert found.inverted.tolist() == [0] and not len(found.exclusive)


def test_nothing_waits_for_what_obstacles_name() -> None:
    """A crossing boundary takes no more sweeps than it takes to mend the rest."""
    mesh = Mesh.build(*GEOMETRIES["plate with holes"]())
    points = mesh.points.copy()
    hole = (np.linalg.norm(points[:, :2] - [0.8, 1.25], axis=1) < 0.36) & ~mesh.movable
    points[hole, 1] += 0.5
    outcome = untangle(mesh.with_points(points))
    assert not outcome.valid
    assert len([record for record in outcome.records if record.phase.startswith("FF")]) <= 30
    assert outcome.obstacles.hopeless(mesh) is not None


def test_a_part_that_is_the_back_of_another_element_has_no_facet_of_its_own() -> None:
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    points = np.concatenate([square, square + np.array([3, 0])])
    mesh = Mesh.build(points, [("quad", [[0, 1, 2, 3], [4, 5, 6, 7], [5, 4, 7, 6]])], fixed=range(4, 8))
    found = find_obstacles(mesh)
    assert (found.inverted.tolist(), found.overlapping.tolist()) == ([2], [])
