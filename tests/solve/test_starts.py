"""The default: where it begins, which start it keeps, and when its smoothing ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from elements import MESHES
from geometries import GEOMETRIES, chamber, grid
from meshes import tangle

from meshfix_cli import Mesh, untangle
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.summary import summarise
from meshfix_cli.solve.passes import Passes
from meshfix_cli.solve.positions import GAIN
from meshfix_cli.solve.records import drain
from meshfix_cli.solve.strategies import PASSES, SMOOTHING, STRATEGIES, THRESHOLD, Move, Phase, plan
from meshfix_cli.solve.untangle import steps


def collapsed(name: str) -> tuple[Mesh, Mesh]:
    """A mesh, and the same with all free vertices in one point."""
    mesh = Mesh.build(*GEOMETRIES[name]())
    middle = mesh.points[mesh.movable].mean(axis=0)
    return mesh, mesh.with_points(np.where(mesh.movable[:, None], middle, mesh.points))


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_lies_far_from_few_inverted_elements_keeps_its_bits(dimension: int) -> None:
    axes = [np.linspace(0, 1, 41)] * 2 if dimension == 2 else [np.linspace(0, 1, 19)] * 3
    mesh = Mesh.build(*grid(*axes))
    points = mesh.points.copy()
    vertex = int(np.argmin(np.linalg.norm(points - 0.3, axis=1)))
    points[vertex] += 0.11
    tangled = mesh.with_points(points)
    assert tangled.check()[0] > 0
    outcome = untangle(tangled)
    assert outcome.valid
    moved = (outcome.after.points != points).any(axis=1)
    broken = np.zeros(len(points), dtype=bool)
    broken[mesh.topology.simplices[summarise(tangled).inverted_elements]] = True
    assert moved[vertex]
    assert not (moved & ~mesh.topology.grown(broken, 10)).any()
    assert summarise(outcome.after).min_angle >= 0.8 * summarise(mesh).min_angle


def test_a_tangle_all_over_the_mesh_is_not_begun_in_a_part(mesh: Mesh) -> None:
    assert "Laplacian" in {record.phase for record in untangle(tangle(mesh, 100, 2)).records}


@pytest.mark.parametrize("name", ["L-shaped plate", "box with pipes", "sphere shell"])
def test_the_better_start_is_kept(name: str) -> None:
    """Either start alone, Laplacian sweeps or the embedding, ends no better than the two of which one is chosen."""
    _, tangled = collapsed(name)
    both = [phase for phase in STRATEGIES["auto"] if phase.moves or phase.embeds]
    first = [phase for phase in both if phase.from_best]
    passes = plan("auto", PASSES)[-1:]
    outcomes = [drain(steps(tangled, [*phases, *passes])) for phases in (both, first)]
    (_, _, chosen, records), (_, _, alone, _) = outcomes
    assert any(record.phase == "embedding" for record in records)
    one, other = summarise(chosen), summarise(alone)
    assert one.inverted <= other.inverted
    if one.inverted == other.inverted == 0:
        assert one.min_angle > other.min_angle - 0.1


@pytest.mark.parametrize("name", ["L-shaped plate", "box with pipes", "quads and triangles", "hex plate"])
def test_the_passes_that_chose_the_start_are_those_of_smoothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same bits as where the smoothing begins anew."""
    mesh = Mesh.build(*MESHES[name]()) if name in MESHES else Mesh.build(*GEOMETRIES[name]())
    middle = mesh.points[mesh.movable].mean(axis=0)
    tangled = mesh.with_points(np.where(mesh.movable[:, None], middle, mesh.points))
    used, begin = [], Passes.begin

    def noted(*given: Any) -> bool:
        used.append(begin(*given))
        return used[-1]

    monkeypatch.setattr(Passes, "begin", noted)
    known = untangle(tangled)
    monkeypatch.setattr(Passes, "begin", lambda *_: False)
    anew = untangle(tangled)
    assert True in used
    assert known.after.points.tobytes() == anew.after.points.tobytes()
    assert [(r.phase, r.sweep, r.inverted, r.moved) for r in known.records] == [
        (r.phase, r.sweep, r.inverted, r.moved) for r in anew.records
    ]


@pytest.mark.parametrize("name", ["plate with holes", "annulus", "box with pipes", "block"])
@pytest.mark.parametrize("sizes", [1e4, 1e8, 1e10, 1e12])
def test_a_vertex_thrown_far_away_comes_back(name: str, sizes: float, random: np.random.Generator) -> None:
    mesh = Mesh.build(*GEOMETRIES[name]())
    points = mesh.points.copy()
    direction = random.normal(size=mesh.dimension)
    size = np.ptp(points, axis=0).max()
    points[random.choice(np.flatnonzero(mesh.movable))] += sizes * size * direction / np.linalg.norm(direction)
    outcome = untangle(mesh.with_points(points))
    assert outcome.valid
    assert summarise(outcome.after).min_angle > 0.5 * summarise(mesh).min_angle


def test_the_embedding_stays_within_the_bound(plate: Mesh) -> None:
    tangled = tangle(plate, 100, 8)
    h = tangled.mean_edge_length()
    for bound in (0.5 * h, 4 * h):
        meshes = [mesh for mesh, record in steps(tangled, STRATEGIES["auto"], max_move=bound)]
        for mesh in meshes:
            assert np.linalg.norm(mesh.points - tangled.points, axis=1).max() <= bound


@pytest.mark.parametrize("name", ["L-shaped plate", "O-grid", "block", "Kuhn cube", "box 1:1000", "corner 1:1e6"])
def test_no_result_after_a_hard_tangle_is_poor(name: str) -> None:
    mesh, tangled = collapsed(name)
    outcome = untangle(tangled)
    assert outcome.valid
    assert summarise(outcome.after).min_angle >= 0.5 * summarise(mesh).min_angle
    free = mesh.movable[mesh.topology.simplices].any(axis=1)
    before, after = (evaluate("min_angle", one)[free].min() for one in (mesh, outcome.after))
    assert after >= min(before, THRESHOLD[mesh.dimension])


def test_smoothing_goes_on_only_where_three_passes_leave_something(mesh: Mesh) -> None:
    free = mesh.movable[mesh.topology.simplices].any(axis=1)
    went_on = set()
    for threshold in (2.0, 5.0, 40.0):
        tangled = tangle(mesh, 5, 0.5)
        smallest = evaluate("min_angle", untangle(tangled, smooth=PASSES, threshold=threshold).after)[free].min()
        phases = {record.phase for record in untangle(tangled, threshold=threshold).records}
        assert (f"{SMOOTHING} the rest" in phases) == (smallest < threshold)
        went_on.add(smallest < threshold)
    assert went_on == {False, True}


@pytest.mark.parametrize("name", ["block", "O-grid", "Koch", "sphere shell"])
def test_the_best_is_nearly_a_fixed_point_and_no_worse_than_the_default(name: str) -> None:
    mesh, tangled = collapsed(name)
    default = summarise(untangle(tangled).after, ("mean_ratio",))
    best = untangle(tangled, smooth="best").after
    one, again = (summarise(m, ("mean_ratio",)) for m in (best, untangle(best, smooth="best").after))
    assert one.min_angle >= default.min_angle - GAIN
    assert one.min_angle >= 0.5 * summarise(mesh).min_angle
    assert again.min_angle - one.min_angle < 0.5
    assert again.min_angle >= one.min_angle - GAIN
    assert one.metrics["mean_ratio"][1] > default.metrics["mean_ratio"][1] or one.min_angle > default.min_angle + 0.1


def test_what_the_shape_of_all_loses_of_the_worst_comes_back(mesh: Mesh) -> None:
    """Without sweeps that raise it again, the minimisation is done once more with the smallest angle held."""
    tangled = tangle(mesh, 25, 1)
    raising = plan("auto", "best")
    without = [phase for phase in raising if phase.until != "ceiling"]
    before = drain(steps(tangled, plan("auto", "auto")))[2]
    smallest = evaluate("min_angle", before)[mesh.movable[mesh.topology.simplices].any(axis=1)].min()
    for phases in (raising, without):
        after = drain(steps(tangled, phases))[2]
        now = evaluate("min_angle", after)[mesh.movable[mesh.topology.simplices].any(axis=1)].min()
        assert now >= smallest - GAIN


def test_a_number_of_passes_is_exact(mesh: Mesh) -> None:
    for passes in (1, PASSES, 5):
        phases = plan("auto", passes)
        regular = [phase for phase in phases if phase.smooths and not (phase.layers or phase.slides)]
        assert [(phase.moves, phase.max_sweeps) for phase in regular] == [((Move.COMBINED_SMOOTH,), passes)]
        records = untangle(tangle(mesh, 100, 8), smooth=passes).records
        assert sum(record.phase.startswith(SMOOTHING) for record in records) == passes


def test_a_last_phase_that_makes_it_worse_is_undone() -> None:
    """Where no smoothing begins from the best mesh, that is the result all the same."""
    valid = Mesh.build(*chamber())
    way = valid.points - valid.points.mean(axis=0)
    radius, turn = np.linalg.norm(way, axis=1), np.radians(30)
    inner = valid.topology.boundary & (radius < np.median(radius))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    turned = valid.with_points(np.where(inner[:, None], valid.points + way @ (rotation.T - np.eye(2)), valid.points))
    phases = Phase("LP", (Move.UNTANGLE,), 5), Phase("Laplacian", (Move.LAPLACIAN,), 1)
    *_, before, (_, laplacian), (after, last) = steps(turned, phases)
    assert laplacian.inverted > before[1].inverted
    assert (last.phase, last.inverted) == ("best", before[1].inverted)
    assert after.points.tobytes() == before[0].points.tobytes()
