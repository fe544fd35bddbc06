"""What is drawn of a report: the boundary, the inverted and the worst elements, the series."""

from __future__ import annotations

import numpy as np
import pytest
from elements import MESHES
from geometries import shell
from meshes import sliding_on_curves, tangle
from numpy.typing import NDArray
from reports import FIRST, built, report_on, tangled
from sampling import jacobians, measure
from verdict import vtk_quality

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.summary import summarise, worst_first
from meshfix_cli.report import figures
from meshfix_cli.report.figures import Cells, Scene, convergence, number_of, scene
from meshfix_cli.solve.perturb import perturb
from meshfix_cli.solve.untangle import untangle

FACTORIAL = {2: 2, 3: 6}


def drawn(mesh: Mesh) -> Scene:
    summary = summarise(mesh)
    return scene({"mesh": mesh}, {"mesh": summary.inverted_elements}, worst_first(mesh, summary.inverted_elements, 10))


def enclosed(points: NDArray[np.float64], facets: Cells) -> float:
    """Area or volume within oriented facets; a quadrilateral is between its halves by one diagonal and the other."""
    total = 0.0
    for key, rows in facets.items():
        halves = np.concatenate([rows[:, np.roll(range(4), -k)[:3]] for k in range(4)]) if key == "quad" else rows
        share = 0.5 if key == "quad" else 1.0
        total += share * float(np.linalg.det(points[halves]).sum() / FACTORIAL[points.shape[1]])
    return total


@pytest.mark.parametrize("name", MESHES)
def test_the_boundary_encloses_elements_of_every_type(name: str) -> None:
    points, cells = MESHES[name]()
    picture = drawn(built(name))
    assert enclosed(picture.boundary, picture.facets) == pytest.approx(
        sum(measure(points, key, rows) for key, rows in cells)
    )
    assert set(picture.facets) <= ({"line"} if points.shape[1] == 2 else {"triangle", "quad"})


def test_the_boundary_encloses_the_mesh(mesh: Mesh) -> None:
    """By the divergence theorem, so the facets are all there and all seen from outside."""
    picture, corners = drawn(mesh), mesh.points[mesh.topology.simplices]
    sizes = np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / FACTORIAL[mesh.dimension]
    assert enclosed(picture.boundary, picture.facets) == pytest.approx(sizes)
    assert not picture.coarse


def test_a_boundary_of_many_facets_is_drawn_coarsely(bracket: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    fine = drawn(bracket)
    monkeypatch.setattr(figures, "MOST_FACETS", 900)
    coarse = drawn(bracket)
    assert coarse.coarse
    assert 100 < number_of(coarse.facets) <= 900 < number_of(fine.facets)
    size = np.ptp(fine.boundary, axis=0)
    np.testing.assert_allclose(np.ptp(coarse.boundary, axis=0), size, atol=0.1 * size.max())


def test_a_boundary_of_many_quadrilaterals_is_drawn_coarsely(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "MOST_FACETS", 900)
    coarse = drawn(built("hex bracket"))
    assert coarse.coarse
    assert list(coarse.facets) == ["triangle"]
    assert 100 < number_of(coarse.facets) <= 900
    points, ((key, rows),) = MESHES["hex bracket"]()
    whole = measure(points, key, rows)
    assert enclosed(coarse.boundary, coarse.facets) == pytest.approx(whole, rel=0.2)


@pytest.mark.parametrize("name", ["hex box", "wedges and tets", "tets within hexes"])
def test_creases_of_a_cube_of_elements_of_any_type(name: str) -> None:
    picture = drawn(built(name))
    lengths = np.linalg.norm(np.diff(picture.boundary[picture.creases], axis=1), axis=2)
    assert lengths.sum() == pytest.approx(12)


def test_creases_of_a_cube() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 1) for y in (0, 1) for z in (0, 1)])
    middle = np.full((1, 3), 0.5)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    tets = [[a, b, c, 8] for q in sides for a, b, c in (q[:3], [q[0], *q[2:]])]
    picture = drawn(Mesh.build(np.concatenate([corners, middle]), tets))
    lengths = np.linalg.norm(np.diff(picture.boundary[picture.creases], axis=1), axis=2)
    assert len(picture.creases) == 12
    np.testing.assert_allclose(lengths, 1)


def test_inverted_elements_are_drawn_where_they_are(mesh: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    moved = tangle(mesh)
    state = drawn(moved).states["mesh"]
    (inverted,) = state.inverted.values()
    corners = state.points[inverted]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) <= 1e-12).all()
    assert (state.drawn, state.left_out) == (moved.check()[0], 0)
    monkeypatch.setattr(figures, "MOST_INVERTED", 7)
    monkeypatch.setattr(figures, "MOST_CELLS", 0)
    state = drawn(moved).states["mesh"]
    assert (number_of(state.cells), state.drawn, state.left_out) == (0, 7, moved.check()[0] - 7)


@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_inverted_elements_of_every_type_are_drawn_where_they_are(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = tangled(name)
    state, cells = drawn(mesh).states["mesh"], dict(MESHES[name]()[1])
    expected = mesh.check()[0]
    assert (state.drawn, state.left_out) == (expected, 0)
    assert number_of(state.cells) == (mesh.topology.m if mesh.dimension == 2 else 0)
    for key, rows in state.inverted.items():
        smallest = jacobians(mesh.points, key, cells[key], 8).min(axis=1)
        found = {tuple(map(tuple, corners)) for corners in state.points[rows].tolist()}
        assert {tuple(map(tuple, corners)) for corners in mesh.points[cells[key][smallest < 0]].tolist()} <= found
    monkeypatch.setattr(figures, "MOST_INVERTED", 50)
    monkeypatch.setattr(figures, "MOST_CELLS", 0)
    state = drawn(mesh).states["mesh"]
    assert (number_of(state.cells), state.drawn, state.left_out) == (0, 50, expected - 50)


@pytest.mark.parametrize("name", MESHES)
def test_the_worst_elements_have_the_smallest_scaled_jacobians(name: str) -> None:
    mesh = built(name)
    values = np.empty(mesh.topology.m)
    for block in mesh.topology.blocks:
        values[block.rows] = vtk_quality("scaled_jacobian", block.element, mesh.points[block.vertices])
    worst = figures.figures(report_on(mesh)).worst
    np.testing.assert_allclose([one.quality for one in worst], np.sort(values)[:10], atol=1e-12)
    for one in worst:
        row = one.id - FIRST
        (block,) = (block for block in mesh.topology.blocks if row in block.rows)
        nodes = mesh.points[block.vertices[np.searchsorted(block.rows, row)]]
        assert one.name == f"{block.element.shape.name} {one.id}"
        np.testing.assert_array_equal(one.corners, nodes)
        np.testing.assert_allclose(one.centroid, nodes.mean(axis=0), atol=1e-12)
        assert values[row] == pytest.approx(one.quality, abs=1e-12)
        alone = np.arange(len(nodes), dtype=np.int32)[None]
        assert one.measure == pytest.approx(measure(nodes, block.element.key, alone))


def test_the_worst_are_the_inverted_then_the_smallest_angles(mesh: Mesh) -> None:
    angles = evaluate("min_angle", mesh)
    assert worst_first(mesh, np.empty(0, dtype=np.int32), 5).tolist() == np.argsort(angles, kind="stable")[:5].tolist()
    best = np.argsort(-angles)[:2].astype(np.int32)
    first = worst_first(mesh, best, 4)
    assert set(first[:2].tolist()) == set(best.tolist())
    assert first[2:].tolist() == np.argsort(angles, kind="stable")[:2].tolist()


def test_convergence_is_that_of_the_records(bracket: Mesh) -> None:
    records = untangle(tangle(bracket)).records
    series = convergence(records)
    assert series.inverted == tuple(record.inverted for record in records)
    assert series.measures == tuple(record.min_measure for record in records)
    assert series.smoothing is not None
    assert series.inverted[series.smoothing] == 0
    assert records[series.smoothing + 1].phase == "smoothing"
    assert convergence(records[: series.smoothing + 1]).smoothing is None


def test_facets_that_have_come_off_their_shape_are_drawn_by_how_far() -> None:
    """The distances of their middles from the boundary as it was are trimesh's."""
    closest = pytest.importorskip("trimesh.proximity").closest_point_naive
    trimesh = pytest.importorskip("trimesh")
    valid = sliding_on_curves(Mesh.build(*shell()))
    moved, _ = perturb(valid, 100, 0.3 * valid.mean_edge_length())
    here, there = (drawn(one).states["mesh"] for one in (valid, moved))
    assert not any(number_of(cells) for cells in here.off.values())
    shape, shapes = drawn(valid), valid.freedom.shapes if valid.freedom else None
    assert shapes is not None
    was = trimesh.Trimesh(shape.boundary, shape.facets["triangle"], process=False)
    least = np.array([share for _, share in figures.OFF] + [np.inf]) * shapes.bound
    for i, cells in enumerate(there.off.values()):
        corners = there.points[cells["triangle"]]
        middles = [corners.mean(axis=1), *np.swapaxes((corners + np.roll(corners, 1, axis=1)) / 2, 0, 1)]
        far = np.max([closest(was, some)[1] for some in middles], axis=0)
        assert len(far) > 5
        assert (far >= least[i] * (1 - 1e-9)).all()
        assert (far <= least[i + 1] * (1 + 1e-9)).all()
