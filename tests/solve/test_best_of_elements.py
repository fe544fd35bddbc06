""" "best" where elements are not all simplices: no figure is below the default's, and the worst corners count most."""

from __future__ import annotations

import numpy as np
import pytest
from elements import MESHES, tangles

from meshfix_cli import Mesh, kernels, untangle
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.solve.compared import KEPT, SHAPE_KEPT, Compared
from meshfix_cli.solve.even import ceiling
from meshfix_cli.solve.shape import SHARP, SHARP_WEIGHT, Goal, shaped
from meshfix_cli.solve.team import Alone


def tangled(name: str, how: str) -> Mesh:
    mesh = Mesh.build(*MESHES[name]())
    return mesh.with_points(tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length())[how])


def corners(mesh: Mesh) -> np.ndarray:
    return np.sin(Judged(mesh.topology.stars(1)).angles(mesh.along_curve(mesh.points), 1))


@pytest.mark.parametrize("name", ["quad plate", "graded hexes", "hexes beside tets", "hex plate", "every solid"])
def test_no_figure_is_below_the_defaults(name: str) -> None:
    mesh = tangled(name, "P=25 D=2h")
    default, best = untangle(mesh).after, untangle(mesh, smooth="best").after
    assert best.check()[0] == 0
    worst = [evaluate("shape", mesh).min() for mesh in (default, best)]
    assert worst[1] >= SHAPE_KEPT * worst[0] - 1e-8  # edges do not shrink to nothing
    for before, after in (
        (evaluate("scaled_jacobian", default), evaluate("scaled_jacobian", best)),
        (corners(default), corners(best)),
    ):
        assert after.min() >= before.min() - 1e-8
        assert after.mean() >= before.mean() - 1e-8
    figures = [evaluate("scaled_jacobian", mesh) for mesh in (default, best)]
    assert np.percentile(figures[1], 1, method="lower") >= KEPT * np.percentile(figures[0], 1, method="lower") - 1e-8


def test_what_has_become_flat_is_not_taken() -> None:
    """Scaled Jacobians of boxes are 1, however flat they are."""
    mesh = Mesh.build(*MESHES["hex box"]())
    elements = Judged(mesh.topology.stars(1))
    compared = Compared(mesh, elements, np.ones(len(elements), dtype=bool), Alone(mesh, 1), 1)
    points = mesh.along_curve(mesh.points)

    def vertices_of(mask: np.ndarray) -> np.ndarray:
        return np.isin(np.arange(len(points)), elements.vertices(mask))

    compared.add(points, vertices_of)
    low, flat = (points * [1, 1, size] for size in (0.9, 0.01))
    assert compared.add(low, vertices_of) is low
    assert evaluate("shape", mesh.with_vertices(flat)).min() < SHAPE_KEPT
    assert evaluate("shape", mesh.with_vertices(compared.add(flat, vertices_of))).min() >= SHAPE_KEPT


def test_the_bits_are_those_of_one_thread() -> None:
    mesh = tangled("hexes and wedges", "P=25 D=2h")
    ends = {untangle(mesh, smooth="best", threads=threads).after.points.tobytes() for threads in (1, 2, 3)}
    assert len(ends) == 1


def test_sizes_are_made_even_where_a_hard_tangle_left_them_uneven() -> None:
    mesh = tangled("quad rings", "hole turned by 20°")
    outcome = untangle(mesh)
    names = [record.phase for record in outcome.records]
    assert names[-1] == "smoothing to even sizes"
    assert corners(outcome.after).mean() > 0.95
    assert outcome.records[-1].inverted == 0


@pytest.mark.parametrize("sharpness", [2.0, 15.0])
def test_the_sharp_energy_is_between_mean_and_smallest_of_the_corners(sharpness: float) -> None:
    mesh = untangle(tangled("hexes of tets", "P=25 D=2h"), smooth=1).after
    stars, points = mesh.topology.stars(1), np.ascontiguousarray(mesh.along_curve(mesh.points))
    simplices, owners = stars.simplices, np.ascontiguousarray(stars.owners)
    weights, hexahedra = np.ones(len(simplices)), np.empty((0, 8), dtype=np.int32)
    energy, _ = kernels.shape_energy(
        points, simplices, weights, owners, hexahedra, 1, 0.0, 0.0, 0.0, 1.0, sharpness, 0.0, 1
    )
    edges = points[simplices[:, 1:]] - points[simplices[:, :1]]
    scaled = (np.linalg.det(edges) / np.linalg.norm(edges, axis=2).prod(axis=1)).reshape(-1, 8)
    soft = -np.log(np.exp(-sharpness * scaled).mean(axis=1)) / sharpness
    assert (soft <= scaled.mean(axis=1) + 1e-12).all()
    assert (soft >= scaled.min(axis=1)).all()
    assert energy == pytest.approx(-100 * 8 * soft.sum(), rel=1e-9)
    even, _ = kernels.shape_energy(
        points, simplices, weights, owners, hexahedra, 1, 0.0, 0.0, 0.0, 1.0, sharpness, 0.5, 1
    )
    ratios = 3 * np.linalg.det(edges) ** (2 / 3) / (edges**2).sum(axis=(1, 2))
    assert ratios.max() <= 1 + 1e-12  # a cube's corners have 1
    assert energy - even == pytest.approx(100 * 0.5 * ratios.sum(), rel=1e-6)


def test_the_sharp_energy_counts_centres_as_corners() -> None:
    mesh = untangle(tangled("hexes of tets", "P=25 D=2h"), smooth=1).after
    stars, points = mesh.topology.stars(1), np.ascontiguousarray(mesh.along_curve(mesh.points))
    simplices, owners, nodes = stars.simplices, np.ascontiguousarray(stars.owners), stars.nodes.reshape(-1, 8)
    edges = points[simplices[:, 1:]] - points[simplices[:, :1]]
    scaled = (np.linalg.det(edges) / np.linalg.norm(edges, axis=2).prod(axis=1)).reshape(-1, 8)
    x = points[nodes]
    axes = np.stack([
        x[:, [1, 2, 5, 6]].sum(axis=1) - x[:, [0, 3, 4, 7]].sum(axis=1),
        x[:, [2, 3, 6, 7]].sum(axis=1) - x[:, [0, 1, 4, 5]].sum(axis=1),
        x[:, 4:].sum(axis=1) - x[:, :4].sum(axis=1),
    ], axis=1)  # fmt: skip
    centres = np.linalg.det(axes) / np.linalg.norm(axes, axis=2).prod(axis=1)
    hexahedra = nodes.copy()
    hexahedra[5] = -1  # its centre does not count
    sums = np.exp(-15 * scaled).sum(axis=1) + np.exp(-15 * centres)
    soft = -np.log(sums / 9) / 15
    soft[5] = -np.log(np.exp(-15 * scaled[5]).mean()) / 15
    energy, _ = kernels.shape_energy(
        points, simplices, np.ones(len(simplices)), owners, hexahedra, 1, 0.0, 0.0, 0.0, 1.0, 15.0, 0.0, 1
    )
    assert energy == pytest.approx(-800 * soft.sum(), rel=1e-9)


def test_a_turned_wall_leaves_no_poor_element() -> None:
    mesh = Mesh.build(*MESHES["hex shell"]())
    for smooth in ("auto", "best"):
        outcome = untangle(tangled("hex shell", "hole turned by 20°"), smooth=smooth)
        assert outcome.after.check()[0] == 0
        assert corners(outcome.after).min() > 0.5 * corners(mesh).min()


def test_edges_that_have_shrunk_grow_again() -> None:
    # Scaled Jacobians do not see it, and no minimiser of them alone gets on from there.
    mesh = Mesh.build(*MESHES["hex box"]())
    stars, free = mesh.topology.stars(1), mesh.along_curve(mesh.movable)
    points, h, edges = mesh.along_curve(mesh.points), mesh.mean_edge_length(), mesh.topology.edges()
    middle = points[np.linalg.norm(points - 0.5, axis=1).argmin()]
    away = np.linalg.norm(points - middle, axis=1, keepdims=True) / h
    start = np.where(free[:, None], middle + (points - middle) * np.minimum(1, (away / 3) ** 3), points)
    assert mesh.with_vertices(start).check()[0] == 0
    after = shaped(start, stars, free, Goal(30.0, stages=SHARP, weight=SHARP_WEIGHT), 1)
    assert mesh.with_vertices(after).check()[0] == 0
    assert corners(mesh.with_vertices(after)).mean() > 0.999 > corners(mesh.with_vertices(start)).mean()
    shortest = [np.linalg.norm(one[edges[0]] - one[edges[1]], axis=1).min() for one in (start, after)]
    assert shortest[1] > 0.5 * h > 5 * shortest[0]


def test_no_motion_of_free_vertices_exceeds_the_ceiling(random: np.random.Generator) -> None:
    mesh = Mesh.build(*MESHES["hex bracket"]())
    free, points = mesh.along_curve(mesh.movable), mesh.along_curve(mesh.points)
    most = ceiling(points, mesh.topology.stars(1), free)
    assert corners(untangle(mesh, smooth="best").after).min() <= most + 1e-12 < 1
    for _ in range(5):
        moved = points + free[:, None] * 0.05 * mesh.mean_edge_length() * random.standard_normal(points.shape)
        assert corners(mesh.with_vertices(moved)).min() <= most + 1e-12
