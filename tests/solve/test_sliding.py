"""Boundaries that slide: the shape is kept, told by coordinates alone, and the mesh is mended."""

from __future__ import annotations

from dataclasses import replace

import elements
import generate
import numpy as np
import pytest
from boxes import may_move, union
from geometries import grid
from meshes import sliding
from numpy.typing import NDArray
from reports import document_of

from meshfix_cli import kernels, repair, untangle
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.document import Document
from meshfix_cli.quality.summary import ceiling, summarise
from meshfix_cli.repair import Method
from meshfix_cli.solve.perturb import perturb
from meshfix_cli.solve.records import Outcome

Points = NDArray[np.float64]
L = np.array([[True, True], [True, False]])
SOLIDS = {
    "L in the plane": L,
    "box": np.ones((1, 1, 1), dtype=bool),
    "L": L[:, :, None],
    "frame": np.pad(np.zeros((1, 1, 1), dtype=bool), ((1, 1), (1, 1), (0, 0)), constant_values=True),
}


def built(name: str, pitch: int = 4) -> tuple[Mesh, Points, NDArray[np.bool_]]:
    solid = SOLIDS[name]
    points, simplices, _ = union(solid, pitch)
    return Mesh.build(points, simplices), points, solid


def signed_size(mesh: Mesh) -> float:
    p = mesh.points[mesh.topology.simplices]
    return float(np.linalg.det(p[:, 1:] - p[:, :1]).sum())


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize(("percent", "distance"), [(25, 1), (25, 2), (50, 2)])
def test_a_boundary_tangled_in_its_planes_is_mended(name: str, percent: float, distance: float) -> None:
    valid, points, solid = built(name)
    mesh = sliding(valid)
    tangled, moved = perturb(mesh, percent, distance * mesh.mean_edge_length(), seed=4)
    assert moved > 0
    assert tangled.check()[0] > 0
    for smooth in ("auto", "best"):
        outcome = untangle(tangled, smooth=smooth)
        assert outcome.valid
        after = outcome.after.points
        # Where a point may not go along an axis, that coordinate has its bits.
        for k in range(points.shape[1]):
            low, high = np.zeros(points.shape[1]), np.zeros(points.shape[1])
            low[k], high[k] = -1e-3, 1e-3
            kept = _is_in(points + low, solid) != _is_in(points + high, solid)
            assert kept.any()
            assert np.array_equal(after[kept, k], points[kept, k])
        corners = may_move(points, solid, 4) == 0
        assert np.array_equal(after[corners], points[corners])
        assert _is_in(after, solid).all()
        assert signed_size(outcome.after) == pytest.approx(signed_size(valid), rel=1e-12)


def _is_in(points: Points, solid: NDArray[np.bool_], pitch: int = 4) -> NDArray[np.bool_]:
    """Whether points are in a closed union of boxes."""
    found = np.zeros(len(points), dtype=bool)
    for corner in np.argwhere(solid) * pitch:
        found |= ((points >= corner) & (points <= corner + pitch)).all(axis=1)
    return found


def test_oblique_planes_are_kept_to_rounding() -> None:
    valid, points, _ = built("box")
    q, _ = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))
    turned = sliding(Mesh.build(points @ q.T + 7.0, valid.topology.simplices))
    tangled, _ = perturb(turned, 25, turned.mean_edge_length(), seed=1)
    outcome = untangle(tangled, smooth="best")
    assert outcome.valid
    back = (outcome.after.points - 7.0) @ q
    for k in range(3):
        for side in (0, 4):
            kept = points[:, k] == side
            assert np.abs(back[kept, k] - side).max() < 1e-14
            assert (back[kept] != points[kept]).any()


def test_sliding_raises_the_ceiling_and_the_smallest_angle() -> None:
    valid = Mesh.build(*generate.bracket(0.25, 5))
    mesh = sliding(valid)
    assert mesh.movable.sum() > valid.movable.sum()
    held, slid = (summarise(untangle(one, smooth="best").after) for one in (valid, mesh))
    assert slid.min_angle > held.min_angle
    before, after = ceiling(valid), ceiling(mesh)
    assert before is not None
    assert after is not None
    assert after > before


def test_interfaces_keep_their_plane() -> None:
    points, simplices, boxes = union(np.ones((2, 1, 1), dtype=bool), 4)
    mesh = sliding(Mesh.build(points, simplices), boxes)
    tangled, _ = perturb(mesh, 25, mesh.mean_edge_length())
    after = untangle(tangled).after
    between = points[:, 0] == 4
    assert np.array_equal(after.points[between, 0], points[between, 0])
    assert (after.points[between] != points[between]).any()


@pytest.mark.parametrize("name", ["hexes", "wedges", "mixed", "quads"])
@pytest.mark.parametrize("distance", [1, 2])
def test_elements_of_all_types_slide(name: str, distance: float) -> None:
    made = {
        "hexes": lambda: elements.box_of_hexahedra(343),
        "wedges": elements.wedges_on_tets,
        "mixed": elements.every_solid,
        "quads": elements.quad_plate,
    }
    valid = Mesh.build(*made[name]())
    mesh = sliding(valid)
    assert mesh.movable.sum() > valid.movable.sum()
    tangled, _ = perturb(mesh, 25, distance * mesh.mean_edge_length())
    outcome = untangle(tangled)
    assert outcome.valid
    freedom, start = mesh.freedom, mesh.along_curve(valid.points)
    assert freedom is not None
    after = mesh.along_curve(outcome.after.points)
    assert np.abs(freedom.onto(after, start) - after).max() < 1e-12


METHODS = [Method(), Method("FF"), Method("CS"), Method("US", sweeps=5), Method(smooth="best")]


@pytest.mark.parametrize("method", METHODS)
def test_the_bits_do_not_depend_on_the_threads(method: Method) -> None:
    valid = Mesh.build(*grid(*[np.linspace(0, 1, 12)] * 3))
    tangled, _ = perturb(sliding(valid), 25, valid.mean_edge_length())
    one, three = (method.solve(tangled, np.inf, threads) for threads in (1, 3))
    assert one.after.points.tobytes() == three.after.points.tobytes()


def test_only_invalid_and_max_move_hold_on_a_sliding_boundary() -> None:
    valid = sliding(Mesh.build(*grid(*[np.linspace(0, 1, 9)] * 3)))
    tangled, _ = perturb(valid, 1, valid.mean_edge_length())
    outcome = untangle(tangled, only_invalid=True)
    assert outcome.valid
    assert (outcome.after.points != tangled.points).any(axis=1).mean() < 0.7
    h = valid.mean_edge_length()
    near = untangle(tangled, max_move=1.2 * h)
    far = np.linalg.norm(near.after.points - tangled.points, axis=1)
    assert near.valid
    assert far.max() <= 1.2 * h
    start = valid.points
    flat = np.isin(start, (0, 1))
    assert np.array_equal(near.after.points[flat], start[flat])


@pytest.mark.parametrize("move", [1, 5, 3, 4, 6, 7])
def test_moves_keep_to_a_line_or_plane(move: int) -> None:
    """Each kind of move, of one vertex in a plane and one on an edge, against a search along its directions."""
    mesh = sliding(Mesh.build(*grid(*[np.linspace(0, 1, 4)] * 3)))
    stars, start = mesh.topology.stars(), mesh.along_curve(mesh.points)
    freedom = mesh.freedom
    assert freedom is not None
    random = np.random.default_rng(5)
    for v in np.flatnonzero(freedom.frame >= 0)[:12]:
        points = start.copy()
        if move in (1, 5):
            points[v] += 0.5 * (freedom.onto(start + random.standard_normal(start.shape), start) - start)[v]
        else:
            points[v] += 0.1 * (freedom.onto(start + random.standard_normal(start.shape), start) - start)[v]
        states = np.zeros(len(points), dtype=np.uint8)
        states[v] = kernels.DUE
        there = points.copy()
        for blocks in mesh.topology.colours:
            kernels.relocate(move, there, states, stars, blocks, 1.0, -np.inf, start, np.inf, 1, freedom.kernel)
        axes = freedom.axes[freedom.frame[v]][: freedom.directions[freedom.frame[v]]]
        way = there[v] - start[v]
        assert np.allclose(axes.T @ (axes @ way), way, atol=1e-15)
        mine = stars.simplices[(stars.simplices == v).any(axis=1)]

        def smallest(at: Points, v: int = int(v), mine: NDArray[np.int32] = mine, base: Points = points) -> float:
            moved = base.copy()
            moved[v] = at
            return float(kernels.measure(moved, mine, 1)[0].min())

        if move == 1:  # no place along its directions is better
            best = smallest(there[v])
            steps = np.linspace(-0.4, 0.4, 17)
            for step in np.stack(np.meshgrid(*[steps] * len(axes), indexing="ij"), axis=-1).reshape(-1, len(axes)):
                assert smallest(there[v] + step @ axes) <= best + 1e-12


def test_a_boundary_that_is_not_tangled_stays_until_the_inside_is_mended() -> None:
    """Laplacian sweeps would draw it together where its faces are not convex."""
    valid = Mesh.build(*elements.hex_bracket())
    tangled, _ = perturb(valid, 25, 2 * valid.mean_edge_length())
    outcome = untangle(sliding(tangled), smooth=0)
    assert outcome.valid
    boundary = valid.topology.boundary
    assert np.array_equal(outcome.after.points[boundary], valid.points[boundary])


def test_less_slides_where_more_leads_astray(monkeypatch: pytest.MonkeyPatch) -> None:
    """What sliding leaves inverted is solved with the boundary held, and that is told."""
    valid = Mesh.build(*generate.bracket(0.3, 4))
    document = document_of(perturb(valid, 25, valid.mean_edge_length())[0])
    document = replace(
        document, solved=replace(document.solved, rest=()), holds={"on the boundary": valid.topology.boundary}
    )
    monkeypatch.setattr(repair.Method, "freed", freed)

    def solve(mesh: Mesh, reach: float) -> Outcome:
        return Method(smooth=0, sweeps=0 if mesh.freedom is not None else None).solve(mesh, reach, 1)

    last, outcome, notes = repair._solved(document, Method(slide="flat"), solve, np.inf, None)
    assert outcome.valid
    assert last.mesh.freedom is None
    assert [note for note in notes if note.startswith("--slide flat would leave ") and note.endswith("none is taken")]
    _, _, silent = repair._solved(document, Method(), solve, np.inf, None)
    assert silent == ()


def freed(method: Method, document: Document, reference: Points | None = None, with_shape: bool = True) -> Document:
    """As the method of this name, of documents that no file stands behind."""
    del reference, with_shape
    return document if method.slide == "none" else replace(document, mesh=sliding(document.mesh))


def test_the_untangled_mesh_is_that_before_smoothing() -> None:
    tangled = perturb(Mesh.build(*generate.bracket(0.3, 4)), 25, 0.2)[0]
    plain, best = (untangle(tangled, smooth=smooth) for smooth in (0, "best"))
    assert best.untangled.points.tobytes() == plain.after.points.tobytes()
