"""Boundaries that slide on their surfaces and along their curves."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import elements
import generate
import numpy as np
import pytest
from geometries import bent, circle, polygon, rings, shell
from meshes import sliding_on_curves
from numpy.typing import NDArray

from meshfix_cli import untangle
from meshfix_cli.mesh.freedom import Freedom
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.summary import change_of_shape, summarise
from meshfix_cli.repair import Method
from meshfix_cli.solve.perturb import Distance, perturb
from meshfix_cli.solve.records import drain
from meshfix_cli.solve.strategies import Move, plan
from meshfix_cli.solve.untangle import steps

Points = NDArray[np.float64]


def freedom_of(mesh: Mesh) -> Freedom:
    assert mesh.freedom is not None
    return mesh.freedom


def tangled(valid: Mesh, percent: float = 25, distance: float = 1, seed: int = 0) -> Mesh:
    mesh, _ = perturb(sliding_on_curves(valid), percent, distance * valid.mean_edge_length(), seed)
    assert mesh.check()[0] > 0
    return mesh


def deviation(mesh: Mesh) -> float:
    """How far the middles of edges and triangles around curved vertices are from their shapes, found one by one."""
    shapes, points = freedom_of(mesh).shapes, mesh.along_curve(mesh.points)
    assert shapes is not None
    here = np.repeat(np.arange(len(points)), np.diff(shapes.offsets))
    a, b, shape, _ = shapes.around.T
    middles = (points[here] + points[a]) / 2
    centres = np.where(b[:, None] < 0, middles, (points[here] + points[a] + points[b]) / 3)
    kernel, shape = shapes.kernel, np.ascontiguousarray(shape)
    return max(float(kernel.nearest(one, shape, 1)[1].max()) for one in (middles, centres))


def off_shape(mesh: Mesh) -> float:
    """How far curved vertices are from the rounded shape, or its pieces."""
    return float(freedom_of(mesh).rounded(mesh.along_curve(mesh.points))[1].max())


@pytest.mark.parametrize("bound", [0.01, 0.03, 0.1])
def test_facets_stay_near_the_shape_and_the_smallest_angle_rises(bound: float) -> None:
    valid = Mesh.build(*bent())
    mesh = sliding_on_curves(valid, bound)
    held, slid = (untangle(one, smooth="best").after for one in (valid, mesh))
    assert summarise(slid).min_angle > summarise(held).min_angle + (10 if bound >= 0.03 else 1)
    assert deviation(slid) <= bound * valid.mean_edge_length() * (1 + 1e-9)
    assert off_shape(slid) < 0.02 * valid.mean_edge_length()
    change = change_of_shape(valid, slid)
    assert 0 < change["hausdorff"] < 3 * bound * valid.mean_edge_length()
    assert abs(change["size"]) < 2e-3
    assert abs(change["boundary"]) < 2e-3


def test_vertices_of_spheres_stay_near_these() -> None:
    valid = Mesh.build(*shell())
    after = untangle(sliding_on_curves(valid), smooth="best").after
    h = valid.mean_edge_length()
    outside = valid.topology.boundary
    assert (after.points[outside] != valid.points[outside]).any(axis=1).sum() > 100
    off = np.linalg.norm(after.points[outside], axis=1) - np.linalg.norm(valid.points[outside], axis=1)
    assert np.abs(off).max() < 0.01 * h  # a triangle's middle is .04 h inside


@pytest.mark.parametrize("name", ["shell", "bent", "disc"])
@pytest.mark.parametrize(("percent", "distance"), [(25, 1), (50, 1)])
def test_a_boundary_tangled_on_its_surfaces_is_mended(name: str, percent: float, distance: float) -> None:
    made: dict[str, Callable[[], tuple[Points, NDArray[np.int32]]]]
    made = {"shell": shell, "bent": bent, "disc": partial(rings, 1.0, 2.0, 60)}
    valid = Mesh.build(*made[name]())
    mesh = tangled(valid, percent, distance)
    far = change_of_shape(valid, mesh)["hausdorff"]
    for smooth in ("auto", "best"):
        outcome = untangle(mesh, smooth=smooth)
        assert outcome.valid
        assert change_of_shape(valid, outcome.after)["hausdorff"] < far
        assert off_shape(outcome.after) < 0.02 * valid.mean_edge_length()
    back = untangle(mesh, reference=valid)
    assert back.valid
    assert np.abs(back.after.points - valid.points).max() < 1e-3


def test_no_vertex_passes_a_corner() -> None:
    loop = circle(0, 0, 1.0, 48)
    plane = polygon(0.15, loop[loop[:, 1] > -1e-9])
    for valid in (Mesh.build(*plane), Mesh.build(*generate.extruded(*plane, np.linspace(0, 0.6, 5)))):
        mesh = tangled(valid, 40)
        p = valid.points
        corner = (np.abs(np.abs(p[:, 0]) - 1) < 1e-9) & (np.abs(p[:, 1]) < 1e-9)
        if valid.dimension == 3:
            edge, corner = corner, corner & np.isin(p[:, 2], (0, 0.6))
            assert edge.sum() > corner.sum() == 4
        after = untangle(mesh, smooth="best").after
        assert np.array_equal(after.points[corner], p[corner])
        round_ = (np.abs(np.linalg.norm(p[:, :2], axis=1) - 1) < 0.01) & (p[:, 1] > 1e-9)
        straight = np.abs(p[:, 1]) < 1e-9
        assert np.abs(after.points[straight, 1] - p[straight, 1]).max() < 1e-15
        assert (after.points[round_, 1] > 0).all()
        if valid.dimension == 2:  # still in their order along the half-circle
            order = np.argsort(np.arctan2(*p[round_].T[::-1]))
            assert (np.diff(np.arctan2(*after.points[round_].T[::-1])[order]) > 0).all()


@pytest.mark.parametrize("name", ["hex_shell", "hex_bracket", "every_solid"])
def test_elements_of_all_types_slide(name: str) -> None:
    valid = Mesh.build(*getattr(elements, name)())
    mesh = sliding_on_curves(valid)
    assert freedom_of(mesh).curved.any() or name == "every_solid"
    broken, _ = perturb(mesh, 10, 0.5 * valid.mean_edge_length(), seed=1)  # 0 leaves one, or none, by the last bits
    outcome = untangle(broken)
    assert outcome.valid
    assert change_of_shape(valid, outcome.after)["hausdorff"] < 0.2 * valid.mean_edge_length()


def test_hexahedra_stay_near_the_shape_and_get_better() -> None:
    """Their candidates are compared, and what is too low in one goes back part of the way."""
    valid = Mesh.build(*elements.hex_bracket())
    mesh, h = sliding_on_curves(valid), valid.mean_edge_length()
    held, slid = (untangle(one, smooth="best").after for one in (valid, mesh))
    before, after = summarise(held).jacobians, summarise(slid).jacobians
    assert before is not None
    assert after is not None
    assert after.smallest > before.smallest + 0.1
    assert after.mean > before.mean
    assert deviation(slid) <= 0.03 * h * (1 + 1e-9)
    assert off_shape(slid) < 0.02 * h


METHODS = [Method(), Method("FF"), Method("CS"), Method("US", sweeps=5), Method("LS", sweeps=2), Method(smooth="best")]


@pytest.mark.parametrize("method", METHODS)
def test_the_bits_do_not_depend_on_the_threads(method: Method) -> None:
    mesh = tangled(Mesh.build(*generate.bracket(0.12, 8)))
    one, two, three = (method.solve(mesh, np.inf, threads).after.points.tobytes() for threads in (1, 2, 3))
    assert one == two == three


def test_only_invalid_and_max_move_hold_on_surfaces() -> None:
    valid = Mesh.build(*generate.bracket(0.12, 8))
    mesh = tangled(valid, 1)
    outcome = untangle(mesh, only_invalid=True)
    assert outcome.valid
    assert (outcome.after.points != mesh.points).any(axis=1).mean() < 0.7
    back = untangle(mesh, only_invalid=True, smooth=0)
    assert back.valid
    for distance in (0.3, 1.2):
        reach = Distance(distance, in_h=True).length(valid)
        near = untangle(mesh, max_move=reach)
        assert np.linalg.norm(near.after.points - mesh.points, axis=1).max() <= reach


def test_a_valid_mesh_does_not_get_worse() -> None:
    valid = Mesh.build(*generate.bracket(0.12, 8))
    after = untangle(sliding_on_curves(valid), smooth=5, threshold=30).after
    assert after.check()[0] == 0
    assert summarise(after).min_angle >= summarise(valid).min_angle


@pytest.mark.parametrize("made", [shell, bent])
def test_facets_that_have_left_the_shape_come_back_to_it_while_the_mesh_stays_valid(
    made: Callable[[], tuple[Points, NDArray[np.int32]]],
) -> None:
    mesh, phases = tangled(Mesh.build(*made()), 50), plan("auto", 0)
    without = [phase for phase in phases if Move.DRAW_BACK not in phase.moves]
    left, back = (drain(steps(mesh, some))[2] for some in (without, phases))
    assert back.check()[0] == 0
    shapes = freedom_of(mesh).shapes
    assert shapes is not None
    far, near = (shapes.deviations(one.along_curve(one.points)) / shapes.bound for one in (left, back))
    assert (near > 1).sum() < (far > 1).sum() / 2
    assert near.max() == pytest.approx(deviation(back) / shapes.bound)
    assert near.max() <= far.max()
