"""Curved elements: repaired, raised, proved impossible, and what is promised of all runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bent import FAMILIES, curved, mesh_of, straight
from monomials import perturbed
from numpy.typing import NDArray
from scipy.optimize import linprog

from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.quadratic import Array, Quadratic
from meshfix_cli.quality.summary import summarise
from meshfix_cli.repair import Method
from meshfix_cli.solve.limits import Limits
from meshfix_cli.solve.quadratic import PARTS, POOR, relaxed, steps

every = pytest.mark.parametrize("key", list(FAMILIES))


def repaired(quadratic: Quadratic, points: Array, limits: Limits, highest: float | None = 0.26) -> Array:
    found = [moved for _, moved in steps(quadratic, points, limits, highest)]
    return found[-1] if found else points


@every
def test_elements_become_valid_and_better(key: str) -> None:
    quadratic, points, free = curved(key, 0.8)
    before = quadratic.judge(points, 1)
    after = quadratic.judge(repaired(quadratic, points, Limits(free, points)), 1)
    assert (before.verdicts != VALID).any()
    assert (after.verdicts == VALID).all()
    assert after.smallest.min() > POOR


@every
def test_held_nodes_keep_their_bits_and_threads_make_no_difference(key: str) -> None:
    quadratic, points, free = curved(key, 0.8)
    found = [repaired(quadratic, points, Limits(free, points, threads=threads)) for threads in (1, 2, 3)]
    assert found[0].tobytes() == found[1].tobytes() == found[2].tobytes()
    assert found[0][~free].tobytes() == points[~free].tobytes()


def test_no_node_goes_farther_than_it_may() -> None:
    quadratic, points, free = curved("tetra10", 0.8)
    for reach in (0.02, 0.1):
        moved = repaired(quadratic, points, Limits(free, points, reach))
        assert 0 < np.linalg.norm(moved - points, axis=1).max() <= reach
        assert (quadratic.judge(moved, 1).verdicts != VALID).sum() < (
            quadratic.judge(points, 1).verdicts != VALID
        ).sum()


def test_what_is_well_is_left_alone() -> None:
    quadratic, points, free = curved("hexahedron20", 0.1)
    assert quadratic.judge(points, 1).smallest.min() > POOR
    well = float(quadratic.judge(points, 1).scaled_jacobians.min())
    assert list(steps(quadratic, points, Limits(free, points), well)) == []


def test_the_result_turns_with_the_mesh() -> None:
    """The same elements are valid, with the same smallest coefficient, wherever the axes lie."""
    quadratic, points, free = curved("triangle6", 0.8)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    one = quadratic.judge(repaired(quadratic, points, Limits(free, points)), 1).smallest.min()
    other = quadratic.judge(repaired(quadratic, points @ turn, Limits(free, points @ turn)), 1).smallest.min()
    assert one > POOR
    assert other > POOR


def bulging() -> tuple[Quadratic, Array, NDArray[np.bool_]]:
    """A square whose left edge bulges into it by more than its elements are wide."""
    points, rows = straight("triangle6")
    quadratic = Quadratic([("triangle6", rows)], len(points))
    inside = np.asarray(((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1))
    left = (points[:, 0] < 1e-9) & ~quadratic.corners
    points = points.copy()
    points[left, 0] = 0.9
    return quadratic, points, inside


def test_the_boundary_gives_way_by_little() -> None:
    quadratic, points, free = bulging()
    limits = Limits(free, points)
    held = repaired(quadratic, points, limits)
    assert (quadratic.judge(held, 1).verdicts != VALID).any()
    found = relaxed(quadratic, held, limits, ~free & ~quadratic.corners)
    assert found is not None
    assert (quadratic.judge(found, 1).verdicts == VALID).all()
    ways = points[~free] - found[~free]
    assert 0 < ways[:, 0].max() < 0.9  # not as far as the straight edge
    assert (ways >= 0).all()
    assert not ways[:, 1].any()


def impossible() -> tuple[Mesh, int]:
    """At the corner of a square one element alone lies between two edges, which turn past each other; which it is."""
    points, rows = straight("triangle6")
    quadratic, points, free = curved("triangle6", 0.2)
    alone = next(v for v in range(len(points)) if (rows[:, :3] == v).sum() == 1)
    element, place = np.argwhere(rows[:, :3] == alone)[0]
    one, other = rows[element, [3 + place, 3 + (place + 2) % 3]]
    ways = points[[one, other]] - points[alone]
    points[[one, other]] += 1.2 * ways[::-1]
    return mesh_of(quadratic, points, "triangle6", rows, free), int(element)


def test_what_is_impossible_is_named_and_nothing_worse_is_returned() -> None:
    mesh, element = impossible()
    outcome = Method().solve(mesh, math.inf, 1)
    assert outcome.obstacles.inverted.tolist() == [element]
    assert outcome.records[-1].inverted == 1
    relaxing = Method(curving="relax").solve(mesh, math.inf, 1)
    assert relaxing.valid
    curved_ones = summarise(relaxing.after).curved
    assert curved_ones is not None
    assert curved_ones.smallest > 0


def test_what_is_impossible_takes_no_more_sweeps_than_there_are() -> None:
    mesh, _ = impossible()
    for sweeps in range(4):
        records = Method(smooth=0, sweeps=sweeps).solve(mesh, math.inf, 1).records
        assert sum(record.sweep > 0 for record in records) <= sweeps


def test_what_has_negative_coefficients_wherever_its_node_goes_becomes_valid_all_the_same() -> None:
    """One node is free: by the programme, as HiGHS finds it, no position makes all coefficients positive."""
    random, rows, seen = np.random.default_rng(0), np.arange(10, dtype=np.int32)[None], 0
    quadratic, free = Quadratic([("tetra10", rows)], 10), np.arange(10) == 9
    for _ in range(400):
        points = perturbed(random, "tetra10", 0.13)
        columns, values = quadratic.kernel.columns(points, free.astype(float)), quadratic.kernel.coefficients(points)
        some = np.abs(columns).max(axis=1) > 1e-9
        program = np.column_stack([-columns[some], np.ones(some.sum())])
        best = linprog([0, 0, 0, -1], program, values[some], bounds=[*[(-9, 9)] * 3, (None, 1)]).x[3]
        if quadratic.judge(points, 1).verdicts[0] == VALID or best > -1e-6:
            continue
        outcome = Method(smooth=0).solve(mesh_of(quadratic, points, "tetra10", rows, free), math.inf, 1)
        seen += outcome.valid and outcome.records[-1].phase == PARTS
    assert seen


def test_tangled_corners_are_mended_first_and_nodes_go_along() -> None:
    points, rows = straight("triangle6")
    quadratic, points, free = curved("triangle6", 0.2)
    random = np.random.default_rng(3)
    corners = free & quadratic.corners
    tangled = points + 0.5 * random.uniform(-1, 1, points.shape) * corners[:, None]
    tangled = quadratic.follow(points, tangled)
    mesh = mesh_of(quadratic, tangled, "triangle6", rows, free)
    before, outcome = mesh.check()[0], Method().solve(mesh, math.inf, 1)
    assert before
    assert outcome.valid
    assert any(record.phase.startswith("straight elements") for record in outcome.records)
    assert outcome.after.points[~free].tobytes() == tangled[~free].tobytes()
