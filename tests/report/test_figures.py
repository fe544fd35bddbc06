"""What is drawn of a report: the boundary, the inverted and the worst elements, the series."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import tangle
from numpy.typing import NDArray

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.summary import summarise, worst_first
from meshfix_cli.report import figures
from meshfix_cli.report.figures import Scene, convergence, scene
from meshfix_cli.solve.untangle import untangle

FACTORIAL = {2: 2, 3: 6}


def drawn(mesh: Mesh) -> Scene:
    summary = summarise(mesh)
    return scene({"mesh": mesh}, {"mesh": summary.inverted_elements}, worst_first(mesh, summary.inverted_elements, 10))


def enclosed(points: NDArray[np.float64], facets: NDArray[np.int32]) -> float:
    """Area or volume within oriented facets."""
    return float(np.linalg.det(points[facets]).sum() / FACTORIAL[points.shape[1]])


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
    assert 100 < len(coarse.facets) <= 900 < len(fine.facets)
    size = np.ptp(fine.boundary, axis=0)
    np.testing.assert_allclose(np.ptp(coarse.boundary, axis=0), size, atol=0.1 * size.max())


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
    tangled = tangle(mesh)
    state = drawn(tangled).states["mesh"]
    corners = state.points[state.inverted]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) <= 1e-12).all()
    assert (len(state.inverted), state.left_out) == (tangled.check()[0], 0)
    monkeypatch.setattr(figures, "MOST_INVERTED", 7)
    monkeypatch.setattr(figures, "MOST_CELLS", 0)
    state = drawn(tangled).states["mesh"]
    assert (len(state.cells), len(state.inverted), state.left_out) == (0, 7, tangled.check()[0] - 7)


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
