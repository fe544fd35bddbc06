"""Strategies, smoothing and the promises of the result."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import replace
from typing import Any, Literal

import generate
import numpy as np
import pytest
from elements import MESHES
from geometries import GEOMETRIES
from meshes import tangle, with_an_inverted_fixed_simplex
from scipy.spatial.transform import Rotation
from tables import CASES

from meshfix_cli import kernels, perturb, untangle
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.summary import ceiling, displacement, summarise
from meshfix_cli.report.as_json import history_csv
from meshfix_cli.solve.foldover import MINIMISATIONS, QUICK, REGION_PATIENCE, THOROUGH, Reach, minimisations
from meshfix_cli.solve.perturb import Distance
from meshfix_cli.solve.positions import GAIN
from meshfix_cli.solve.run import NEAR
from meshfix_cli.solve.strategies import SMOOTHING, STRATEGIES, SWEEPS, plan
from meshfix_cli.solve.untangle import steps


@pytest.mark.parametrize("case", CASES)
def test_laplacian_smoothing_untangles_every_case_in_2d(plate: Mesh, case: tuple[int, int]) -> None:
    """The paper's finding below table 4.1."""
    assert untangle(tangle(plate, *case), "LS").valid


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("strategy", ["auto", "LUS"])
def test_default_and_recommended_strategy_solve_every_case(mesh: Mesh, strategy: str, case: tuple[int, int]) -> None:
    for seed in range(3):
        tangled = tangle(mesh, *case, seed=seed)
        assert tangled.check()[0] > 0
        outcome = untangle(tangled, strategy)
        summary = summarise(outcome.after)
        assert outcome.valid
        assert (summary.inverted, summary.folded) == (0, 0)
        assert outcome.after.points[~mesh.movable].tobytes() == mesh.points[~mesh.movable].tobytes()


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_every_strategy_reports_what_it_did(mesh: Mesh, strategy: str) -> None:
    tangled = tangle(mesh)
    outcome = untangle(tangled, strategy)
    untangling = [r for r in outcome.records if not r.phase.startswith(("input", "best", SMOOTHING))]
    assert {r.phase for r in untangling} <= {phase.name for phase in STRATEGIES[strategy]}
    assert 1 <= len(untangling) <= SWEEPS
    assert outcome.records[0].inverted == summarise(tangled).inverted
    assert outcome.records[-1].inverted == summarise(outcome.after).inverted
    assert outcome.records[-1].min_measure == summarise(outcome.after).min_measure
    assert summarise(outcome.untangled).inverted == outcome.records[-1].inverted or not outcome.valid


def test_plans_are_the_papers() -> None:
    phases = [(p.name, p.max_sweeps) for p in plan("LUS", 3) if not (p.elements or p.slides)]
    assert phases == [("Laplacian", 3), ("LP", None), (SMOOTHING, 3)]
    assert [p.max_sweeps for p in plan("US", smooth=10) if not (p.elements or p.slides)] == [None, 10]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_the_limit_is_that_of_all_untangling_sweeps(bracket: Mesh, strategy: str) -> None:
    stuck = with_an_inverted_fixed_simplex(bracket)
    for sweeps in (0, 2, 7, 25, SWEEPS):
        phases = [r.phase for _, r in steps(stuck, plan(strategy, smooth=0), sweeps=sweeps)]
        done = [p for p in phases if p not in ("input", "best")]
        assert len(done) == sweeps or (len(done) < sweeps and done[-1] == "FF")  # which has its own patience here
    assert "LP on invalid stars near inverted elements" in [r.phase for _, r in steps(stuck, plan("auto"), sweeps=8)]
    assert untangle(stuck, strategy).obstacles


def test_valid_mesh_goes_straight_to_smoothing(mesh: Mesh) -> None:
    for strategy in STRATEGIES:
        phases = {r.phase for r in untangle(mesh, strategy, threshold=80).records}
        assert phases == {"input", SMOOTHING, f"{SMOOTHING} the rest"}
    assert untangle(mesh, smooth=0).after is mesh


def test_a_mesh_that_meets_the_target_is_left_alone(mesh: Mesh) -> None:
    free = mesh.movable[mesh.topology.simplices].any(axis=1)
    smallest = evaluate("min_angle", mesh)[free].min()
    assert summarise(mesh).min_angle <= smallest  # others may be worse: nothing can be done about them
    assert untangle(mesh, threshold=0.999 * smallest).after is mesh
    assert untangle(mesh, threshold=1.001 * smallest).after is not mesh
    held = mesh.with_fixed(mesh.movable)
    assert untangle(held, threshold=80).after is held


@pytest.mark.parametrize("smooth", [12, "auto"])
def test_smoothing_never_lowers_the_worst_quality_of_the_mesh(mesh: Mesh, smooth: int | Literal["auto"]) -> None:
    worst = -math.inf
    for current, record in steps(tangle(mesh, 5, 0.3), plan("auto", smooth)):
        if record.phase.startswith(SMOOTHING) or record.inverted == 0:
            now = evaluate("min_sine", current).min()
            assert now >= worst * (1 - 1e-11)
            worst = now
    assert math.degrees(math.asin(worst)) > 0.9 * summarise(mesh).min_angle


@pytest.mark.parametrize("case", [(25, 2), (100, 8)])
def test_the_best_smoothing_is_better_in_every_figure(mesh: Mesh, case: tuple[int, int]) -> None:
    tangled = tangle(mesh, *case)
    default, best = untangle(tangled), untangle(tangled, smooth="best")
    one, two = summarise(default.after), summarise(best.after)
    assert best.valid
    assert two.min_angle >= one.min_angle - GAIN
    assert two.mean_min_angle > one.mean_min_angle
    assert two.percentile_1 >= one.percentile_1 - 0.5
    assert [r.phase for r in best.records][-1].startswith(SMOOTHING)
    assert best.untangled.points.tobytes() == default.untangled.points.tobytes()


def test_the_best_smoothing_goes_to_the_ceiling_or_to_where_nothing_rises(mesh: Mesh) -> None:
    tangled = tangle(mesh)
    best = untangle(tangled, smooth="best").after
    top = ceiling(mesh)
    assert top is not None
    smallest = summarise(best).min_angle
    assert smallest <= top * (1 + 1e-12)
    if smallest < top * (1 - 1e-9):  # further sweeps do not help
        again = untangle(best, smooth="best").after
        assert summarise(again).min_angle < smallest + 0.5


def test_the_best_smoothing_comes_to_rest(mesh: Mesh) -> None:
    """A run that gains nothing gives back what it got."""
    current, runs = untangle(tangle(mesh), smooth="best").after, 0
    while (after := untangle(current, smooth="best").after) is not current and runs < 10:
        assert summarise(after).mean_min_angle > summarise(current).mean_min_angle or (
            summarise(after).min_angle > summarise(current).min_angle
        )
        current, runs = after, runs + 1
    assert runs < 6


@pytest.mark.parametrize(
    "wrong", [{"smooth": "bset"}, {"smooth": -1}, {"smooth": 2.5}, {"threshold": 100}, {"max_move": -1}]
)
def test_arguments_out_of_range_are_refused(plate: Mesh, wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"is neither|and not"):
        untangle(plate, **wrong)


def test_a_strategy_that_there_is_not_is_refused_with_those_that_there_are(plate: Mesh) -> None:
    with pytest.raises(ValueError, match=f"strategy is one of {', '.join(STRATEGIES)}, and not 'XX'"):
        untangle(plate, strategy="XX")


def test_what_cannot_be_mended_does_not_stop_the_best_smoothing(bracket: Mesh) -> None:
    stuck = with_an_inverted_fixed_simplex(tangle(bracket))
    free = bracket.movable[bracket.topology.simplices].any(axis=1)
    default, best = (untangle(stuck, smooth=smooth, threads=2).after for smooth in (3, "best"))
    valid = evaluate("min_sine", best)[free] > 0
    assert valid.sum() >= (evaluate("min_sine", default)[free] > 0).sum()
    assert evaluate("min_angle", best)[free].mean() > evaluate("min_angle", default)[free].mean()


def test_the_best_smoothing_has_the_same_bits_for_any_number_of_threads(fine: Mesh) -> None:
    tangled = tangle(fine)
    outcomes = [untangle(tangled, smooth="best", threads=threads) for threads in (1, 2, 3)]
    assert len({o.after.points.tobytes() for o in outcomes}) == 1


def test_the_best_smoothing_of_a_valid_mesh_is_not_held_back_by_the_threshold(mesh: Mesh) -> None:
    assert untangle(mesh, threshold=1).after is mesh
    best = untangle(mesh, threshold=1, smooth="best")
    assert best.valid
    assert summarise(best.after).mean_min_angle > summarise(mesh).mean_min_angle
    assert summarise(best.after).min_angle >= summarise(mesh).min_angle * (1 - 1e-9)


def test_smoothing_reaches_the_ceiling_that_fixed_vertices_set(bracket: Mesh) -> None:
    after = untangle(tangle(bracket)).after
    assert summarise(after).min_angle == pytest.approx(ceiling(bracket), rel=1e-12)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_impossible_mesh_is_reported_and_not_made_worse(mesh: Mesh, strategy: str) -> None:
    outcome = untangle(with_an_inverted_fixed_simplex(mesh), strategy)
    assert not outcome.valid
    assert outcome.records[-1].rank[0] <= outcome.records[0].rank[0]
    assert outcome.after.check()[0] > 0


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_never_worse_than_the_input(bracket: Mesh, strategy: str) -> None:
    for sweeps in (0, 1, 2):
        outcome = untangle(tangle(bracket, 60, 6), strategy, sweeps=sweeps)
        assert outcome.records[-1].rank[0] <= outcome.records[0].rank[0]


def test_same_bits_for_any_number_of_threads(fine: Mesh) -> None:
    tangled = tangle(fine)
    outcomes = [untangle(tangled, threads=threads) for threads in (1, 2, 3)]
    assert outcomes[0].valid
    assert len({o.after.points.tobytes() for o in outcomes}) == 1
    assert len({tuple((r.inverted, r.min_measure, r.moved) for r in o.records) for o in outcomes}) == 1


def hard(mesh: Mesh) -> Mesh:
    """All interior vertices moved by 8h: the LP and, with `strategy="FF"`, hundreds of evaluations."""
    return tangle(mesh, 100, 8)


@pytest.mark.parametrize("strategy", ["auto", "FF"])
def test_same_bits_of_hard_tangles_for_any_number_of_threads(bracket: Mesh, strategy: str) -> None:
    outcomes = [untangle(hard(bracket), strategy, threads=threads) for threads in (1, 2, 3)]
    assert outcomes[0].valid
    assert len({o.after.points.tobytes() for o in outcomes}) == 1


def test_metres_millimetres_offsets_and_axes_do_not_matter(mesh: Mesh) -> None:
    """Up to 1e-6 mean edges, 1e-4 with other axes, which dozens of sweeps round otherwise; ten digits at an offset."""
    tangled = Mesh.build(hard(mesh).points, mesh.topology.simplices)
    h = tangled.mean_edge_length()
    expected = untangle(tangled)
    assert expected.valid
    turn = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
    if mesh.dimension == 2:
        turn = Rotation.from_euler("z", 50, degrees=True).as_matrix()[:2, :2]
    for scale in (1e3, 1e6, 25.4):
        scaled = untangle(Mesh.build(tangled.points * scale, tangled.topology.simplices))
        assert np.abs(scaled.after.points / scale - expected.after.points).max() < 1e-6 * h
    rotated = untangle(Mesh.build(tangled.points @ turn.T, tangled.topology.simplices))
    assert np.abs(rotated.after.points @ turn - expected.after.points).max() < 1e-4 * h
    size = float(np.ptp(tangled.points, axis=0).max())
    shifted = untangle(Mesh.build(tangled.points + 1e6 * size, tangled.topology.simplices))
    assert shifted.valid
    assert np.abs(shifted.after.points - 1e6 * size - expected.after.points).max() < 1e-3 * h


def turned_hole(angle: float) -> Mesh:
    """An annulus whose hole was turned, its interior left behind."""
    mesh = Mesh.build(*GEOMETRIES["annulus"]())
    inner = ~mesh.movable & (np.linalg.norm(mesh.points, axis=1) < 0.5)
    turn = Rotation.from_euler("z", angle, degrees=True).as_matrix()[:2, :2]
    return mesh.with_points(np.where(inner[:, None], mesh.points @ turn.T, mesh.points))


def test_the_global_methods_solve_what_the_local_ones_do_not() -> None:
    for angle in (120, 180):
        outcome = untangle(turned_hole(angle))
        assert outcome.valid
        assert any(r.phase.startswith(("embedding", "FF")) for r in outcome.records)
        assert not any(untangle(turned_hole(angle), strategy).valid for strategy in ("LS", "US", "CS", "LUS"))
        assert untangle(turned_hole(angle), "FF").valid


def test_the_energy_is_minimised_in_a_region_first() -> None:
    """Two triangles pushed through each other in a corner of a large mesh: what is far away keeps its bits."""
    mesh = Mesh.build(*generate.plate(0.06))
    vertex = int(np.argmin(np.linalg.norm(mesh.points - [2.7, 1.7], axis=1)))
    points = mesh.points.copy()
    points[vertex] += [0.15, 0.0]
    phases = [phase for phase in STRATEGIES["auto"] if phase.name.startswith("FF")]
    *_, (after, record) = steps(mesh.with_points(points), phases)
    assert (record.phase, record.inverted) == ("FF in regions", 0)
    far = np.linalg.norm(mesh.points - mesh.points[vertex], axis=1) > 0.5
    assert after.points[far].tobytes() == mesh.points[far].tobytes()
    assert (after.points != points).any(axis=1).sum() < 60


def test_a_region_that_does_not_help_is_left() -> None:
    """Two rings are too few for a hole that was turned that far; the whole mesh is enough."""
    phase = replace(next(one for one in STRATEGIES["auto"] if one.name == "FF"), rings=(2,))
    records = [record for _, record in steps(turned_hole(150), [phase])]
    left = [record.inverted for record in records if record.phase == phase.name]
    assert len(left) < MINIMISATIONS
    assert min(left[-REGION_PATIENCE:]) >= min(left[:-REGION_PATIENCE])
    assert untangle(turned_hole(150)).valid


def test_a_thorough_minimisation_solves_what_a_quick_one_does_not() -> None:
    mesh = turned_hole(180)
    free, points = mesh.along_curve(mesh.movable), mesh.along_curve(mesh.points)
    for effort, solved in ((QUICK, False), (THOROUGH, True)):
        *_, last = minimisations(points, mesh.topology.stars(), free, Reach(points), 1, (effort,))
        assert (not len(kernels.check(last, mesh.topology.stars().simplices, 1)[0])) == solved
    assert untangle(mesh, "FF").valid


@pytest.mark.parametrize("strategy", ["auto", "FF"])
def test_max_move_bounds_every_displacement(mesh: Mesh, strategy: str) -> None:
    tangled = tangle(mesh, 5, 0.8)
    assert tangled.check()[0] > 0
    h = tangled.mean_edge_length()
    free = displacement(tangled, untangle(tangled, strategy).after)["largest"]
    for bound in (0.9 * free, 0.3 * h, 1e-3 * h, 0.0):
        outcome = untangle(tangled, strategy, max_move=bound, sweeps=60, threads=2)
        assert displacement(tangled, outcome.after)["largest"] <= bound
        assert outcome.records[-1].rank <= outcome.records[0].rank
        assert outcome.valid or bound < 0.9 * free


def test_only_invalid_moves_nothing_else(mesh: Mesh) -> None:
    fine = Mesh.build(*(generate.plate(0.06) if mesh.dimension == 2 else generate.bracket(0.1, 8)))
    vertex = int(np.argmin(np.linalg.norm(fine.points - fine.points[fine.movable][0], axis=1)))
    points = fine.points.copy()
    points[vertex] += 1.5 * fine.mean_edge_length()
    tangled = fine.with_points(points)
    outcome = untangle(tangled, only_invalid=True)
    assert tangled.check()[0] > 0
    assert outcome.valid
    broken = np.zeros(fine.topology.n, dtype=bool)
    broken[fine.topology.simplices[kernels.measure(points, fine.topology.simplices, 1)[1] == 0]] = True
    moved = (outcome.after.points != points).any(axis=1)
    assert moved[vertex]
    assert not (moved & ~fine.topology.grown(broken, NEAR)).any()
    assert moved.sum() < 0.1 * fine.movable.sum()
    assert untangle(fine, only_invalid=True, threshold=80).after is fine


def test_a_valid_mesh_keeps_its_smallest_measure(mesh: Mesh) -> None:
    for threshold in (30, 80):
        outcome = untangle(mesh, threshold=threshold, smooth=10)
        assert outcome.records[-1].rank <= outcome.records[0].rank


def test_what_can_be_mended_is_mended_beside_what_cannot(mesh: Mesh) -> None:
    """One vertex of a simplex without a free one is wrong; the tangle elsewhere is solved all the same."""
    stuck = with_an_inverted_fixed_simplex(mesh)
    both = stuck.with_points(np.where(mesh.movable[:, None], tangle(mesh).points, stuck.points))
    outcome = untangle(both, threads=2)
    assert len(outcome.obstacles.inverted) >= 1
    assert not outcome.valid
    assert outcome.records[-1].inverted <= untangle(stuck, threads=2).records[-1].inverted + 1 < both.check()[0]


def test_where_nothing_is_mended_nothing_else_suffers(plate: Mesh) -> None:
    """A boundary vertex on its neighbour: the element between them has no area, wherever the free vertices go."""
    simplices = plate.topology.simplices
    a, b = next(
        pair for row in simplices for pair in zip(row, np.roll(row, 1), strict=True)
        if not plate.movable[[*pair]].any() and plate.movable[row].any()
    )  # fmt: skip
    points = plate.points.copy()
    points[a] = points[b]
    stuck = plate.with_points(points)
    outcome = untangle(stuck)
    before, after = summarise(stuck), summarise(outcome.after)
    assert not outcome.valid
    assert (after.inverted, outcome.untangled.points.tobytes()) == (before.inverted, points.tobytes())
    assert after.percentile_1 >= before.percentile_1


@pytest.mark.parametrize("scale", [1e-6, 25.4, 1e6])
def test_unit_of_length_does_not_matter(mesh: Mesh, scale: float) -> None:
    tangled = Mesh.build(tangle(mesh).points, mesh.topology.simplices)
    scaled = Mesh.build(tangled.points * scale, tangled.topology.simplices)
    expected, actual = untangle(tangled), untangle(scaled)
    assert [r.inverted for r in actual.records] == [r.inverted for r in expected.records]
    np.testing.assert_allclose(actual.after.points / scale, expected.after.points, atol=1e-7)


def test_offset_does_not_matter(mesh: Mesh) -> None:
    """At a million sizes away a double keeps ten digits of the shape."""
    tangled = tangle(mesh)
    shifted = Mesh.build(tangled.points + 1e6, tangled.topology.simplices)
    outcome = untangle(shifted)
    assert outcome.valid
    expected = summarise(untangle(tangled).after)
    assert summarise(outcome.after).min_angle == pytest.approx(expected.min_angle, rel=0.05)


def test_axes_do_not_matter_to_laplacian_and_smoothing(mesh: Mesh) -> None:
    """The LP's box has axes; nothing else does, and on these stars the box is not reached."""
    tangled = Mesh.build(tangle(mesh, 10, 1).points, mesh.topology.simplices)
    turn = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()
    if mesh.dimension == 2:
        turn = Rotation.from_euler("z", 50, degrees=True).as_matrix()[:2, :2]
    rotated = Mesh.build(tangled.points @ turn.T, tangled.topology.simplices)
    np.testing.assert_allclose(untangle(rotated).after.points @ turn, untangle(tangled).after.points, atol=1e-6)


def test_collapsed_and_pinched_stars_do_no_harm(mesh: Mesh) -> None:
    points = mesh.points.copy()
    points[mesh.movable] = points[mesh.movable][0]
    for strategy in STRATEGIES:
        outcome = untangle(mesh.with_points(points.copy()), strategy)
        assert np.isfinite(outcome.after.points).all()
        assert outcome.records[-1].inverted == outcome.after.check()[0]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_an_interior_in_one_point_is_solved_in_2d(plate: Mesh, strategy: str) -> None:
    points = plate.points.copy()
    points[plate.movable] = [1.5, 1.0]
    assert untangle(plate.with_points(points), strategy).valid


@pytest.mark.parametrize("name", ["quads and triangles", "every solid"])
def test_what_was_solved_before_leaves_no_trace(name: str, plate: Mesh, bracket: Mesh) -> None:
    elements = tangle(Mesh.build(*MESHES[name]()))
    simplices = tangle(plate if elements.dimension == 2 else bracket)
    before = [untangle(mesh).after.points.tobytes() for mesh in (simplices, elements)]
    assert [untangle(mesh).after.points.tobytes() for mesh in (simplices, elements)] == before


@pytest.mark.parametrize("name", ["quads and triangles", "every solid"])
def test_perturb_moves_a_share_of_all_vertices_of_any_elements_by_mean_edge_lengths(name: str) -> None:
    points, blocks = MESHES[name]()
    mesh = Mesh.build(points, blocks)
    edges = {
        (min(a, b), max(a, b))
        for key, rows in blocks
        for row in rows.tolist()
        for facet in ELEMENTS[key].shape.facets
        for a, b in zip((row[i] for i in facet), (row[i] for i in (*facet[1:], facet[0])), strict=True)
    }
    start, end = np.array(sorted(edges)).T
    h = np.linalg.norm(points[end] - points[start], axis=1).mean()
    tangled, count = perturb(mesh, 10, Distance.parse("2h").length(mesh), 7)
    way = np.linalg.norm(tangled.points - points, axis=1)
    assert count == (way > 0).sum() == round(0.1 * len(points))
    assert way[way > 0] == pytest.approx(2 * h)
    assert mesh.movable[way > 0].all()
    more = perturb(mesh, 20, 2 * h, 7)[0]
    np.testing.assert_allclose(more.points[way > 0], tangled.points[way > 0])
    assert perturb(mesh, 100, h)[1] == mesh.movable.sum()


def test_perturb_series_moves_the_same_vertices_in_the_same_directions(bracket: Mesh) -> None:
    moves = {}
    for percent, distance in ((5, 1.0), (25, 1.0), (25, 3.0)):
        moved_mesh, count = perturb(bracket, percent, distance, seed=7)
        assert count == round(percent / 100 * bracket.topology.n)
        moves[percent, distance] = moved_mesh.points - bracket.points
        lengths = np.linalg.norm(moves[percent, distance], axis=1)
        assert (lengths > 0).sum() == count
        np.testing.assert_allclose(lengths[lengths > 0], distance)
    some = (moves[5, 1.0] != 0).any(axis=1)
    np.testing.assert_array_equal(moves[25, 1.0][some], moves[5, 1.0][some])
    np.testing.assert_allclose(moves[25, 3.0], 3 * moves[25, 1.0], atol=1e-12)
    assert not (moves[25, 3.0][~bracket.movable]).any()
    assert perturb(bracket, 100, 1.0)[1] == bracket.movable.sum()
    assert (
        perturb(bracket, 25, 1.0, seed=8)[0].points.tobytes() != perturb(bracket, 25, 1.0, seed=7)[0].points.tobytes()
    )


@pytest.mark.parametrize(("text", "value", "in_h"), [("2h", 2.0, True), ("h", 1.0, True), ("0.3", 0.3, False)])
def test_distances(plate: Mesh, text: str, value: float, in_h: bool) -> None:
    distance = Distance.parse(text)
    assert distance == Distance(value, in_h)
    assert distance.length(plate) == value * (plate.mean_edge_length() if in_h else 1)


@pytest.mark.parametrize("text", ["", "x", "-1", "nan", "infh", "2hh", "1e400"])
def test_distances_refused(text: str) -> None:
    with pytest.raises(ValueError):
        Distance.parse(text)


def test_history_is_the_series_of_figure_4_4(plate: Mesh) -> None:
    outcome = untangle(tangle(plate), "LUS")
    rows = list(csv.DictReader(io.StringIO(history_csv(outcome.records))))
    assert [int(row["inverted"]) for row in rows] == [r.inverted for r in outcome.records]
    assert [float(row["min_measure"]) for row in rows] == [r.min_measure for r in outcome.records]
    assert rows[0]["phase"] == "input"
