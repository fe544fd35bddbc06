"""Metrics against VTK's cell quality, and the summary."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import tangle
from verdict import NAMES, vtk_quality

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.metrics import METRICS
from meshfix_cli.quality.summary import ceiling, summarise


@pytest.mark.parametrize("name", [name for name in NAMES if name != "min_angle"])
def test_metrics_are_verdicts(mesh: Mesh, name: str) -> None:
    expected = vtk_quality(name, mesh.topology.element, mesh.points[mesh.topology.simplices])
    np.testing.assert_allclose(evaluate(name, mesh), expected, rtol=1e-9)


def test_smallest_triangle_angle_is_verdicts(plate: Mesh) -> None:
    expected = vtk_quality("min_angle", plate.topology.element, plate.points[plate.topology.simplices])
    np.testing.assert_allclose(evaluate("min_angle", plate), expected, rtol=1e-9)


def test_dihedral_angles_from_face_normals(bracket: Mesh) -> None:
    """VTK looks at four of the six edges, so the oracle here is the definition."""
    p = bracket.points[bracket.topology.simplices]
    angles = []
    for i, j in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        k, m = sorted({0, 1, 2, 3} - {i, j})
        axis = p[:, j] - p[:, i]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        sides = [v - (v * axis).sum(axis=1, keepdims=True) * axis for v in (p[:, k] - p[:, i], p[:, m] - p[:, i])]
        cosine = (sides[0] * sides[1]).sum(axis=1) / np.prod([np.linalg.norm(s, axis=1) for s in sides], axis=0)
        angles.append(np.degrees(np.arccos(cosine)))
    np.testing.assert_allclose(evaluate("min_angle", bracket), np.min(angles, axis=0), rtol=1e-9)
    assert summarise(bracket).max_angle == pytest.approx(np.max(angles), rel=1e-9)
    np.testing.assert_allclose(evaluate("min_sine", bracket), np.sin(np.radians(angles)).min(axis=0), rtol=1e-9)


@pytest.mark.parametrize("name", METRICS)
@pytest.mark.parametrize("d", [2, 3])
def test_regular_simplex_is_best_and_inverted_is_worst(name: str, d: int) -> None:
    if d == 2:
        points = np.array([[0, 0], [1, 0], [0.5, np.sqrt(3) / 2]])
    else:
        points = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])[[0, 2, 1, 3]]
    regular = Mesh.build(points, [list(range(d + 1))])
    assert not regular.topology.flipped.any()
    angle = 60.0 if d == 2 else np.degrees(np.arccos(1 / 3))
    best = {"min_angle": angle, "min_sine": np.sin(np.radians(angle))}
    assert evaluate(name, regular)[0] == pytest.approx(best.get(name, 1.0))
    mirrored = regular.with_points(np.ascontiguousarray(points * ([-1] + [1] * (d - 1))))
    bad = {"min_sine": -best["min_sine"], "scaled_jacobian": -1.0, "shape": 0.0, "mean_ratio": 0.0, "min_angle": angle}
    assert evaluate(name, mirrored)[0] == pytest.approx(bad.get(name, np.inf))


@pytest.mark.parametrize("name", METRICS)
def test_a_collapsed_element_has_the_worst_value(plate: Mesh, name: str) -> None:
    points = plate.points.copy()
    points[plate.topology.simplices[0]] = points[plate.topology.simplices[0][0]]
    worst, mean = summarise(plate.with_points(points), [name]).metrics[name]
    assert worst == np.inf if METRICS[name].worst == "max" else worst <= 0.0
    assert not np.isnan(mean)


def test_summary_of_a_tangled_mesh(mesh: Mesh) -> None:
    tangled = tangle(mesh)
    summary = summarise(tangled, ["mean_ratio"])
    measure = np.linalg.det(np.diff(tangled.points[tangled.topology.simplices], axis=1))
    assert summary.inverted == (measure <= 0).sum() == len(summary.inverted_elements)
    assert summary.folded > 0
    assert summary.min_measure == pytest.approx(measure.min() / (2 if mesh.dimension == 2 else 6))
    assert summary.metrics["mean_ratio"][0] == 0.0
    assert sum(summary.histogram) == summary.elements == len(measure)
    clean = summarise(mesh)
    assert (clean.inverted, clean.folded) == (0, 0)


def test_two_triangles_folded_over_their_edge() -> None:
    valid = Mesh.build([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [0.5, -2.0]], [[0, 1, 2], [1, 0, 3]])
    assert summarise(valid).folded == 0
    assert summarise(valid.with_points(np.array([[0, 0], [1, 0], [0.5, 1], [0.5, 0.5]]))).folded == 1


def test_ceiling_is_the_smallest_angle_that_cannot_change(plate: Mesh) -> None:
    smallest = evaluate("min_angle", plate)
    stuck = ~plate.movable[plate.topology.simplices].any(axis=1)
    assert ceiling(plate) == pytest.approx(smallest[stuck].min())
    moving = Mesh.build(
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.4, 0.6]], [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    )
    assert ceiling(moving) is None
