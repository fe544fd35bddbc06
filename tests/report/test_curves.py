"""Curved elements are drawn as they are: their edges lie on the curves of their nodes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from bent import FAMILIES, HIGHER, curved, mesh_of, straight
from monomials import Array, mapped, positions, type_of

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.quadratic import Quadratic
from meshfix_cli.quality.summary import summarise, worst_first
from meshfix_cli.report import curves
from meshfix_cli.report.curves import surface
from meshfix_cli.report.figures import Cells, Scene, scene

every = pytest.mark.parametrize("key", list(FAMILIES))


def bent(key: str, size: float = 0.8) -> Mesh:
    quadratic, points, free = curved(key, size)
    return mesh_of(quadratic, points, key, straight(key)[1], free)


def bulging(key: str) -> Mesh:
    """A grid whose corners stay, and whose boundary is curved outwards."""
    points, rows = straight(key)
    quadratic, around = Quadratic([(key, rows)], len(points)), points - 0.5
    out = points + 0.4 * around * (1 - (around**2).sum(axis=1, keepdims=True))
    points = np.where(quadratic.corners[:, None], points, out)
    return mesh_of(quadratic, points, key, rows, np.zeros(len(points), dtype=bool))


def drawn(*meshes: Mesh) -> Scene:
    stages = dict(zip("abc", meshes, strict=False))
    wrong = {name: summarise(mesh).inverted_elements for name, mesh in stages.items()}
    return scene(stages, wrong, worst_first(meshes[-1], list(wrong.values())[-1], 5))


def on_edges(key: str, nodes: Array, pieces: int) -> Array:
    """Points of an element at its corners and on its edges, as the map of its type has them."""
    element = type_of(key)
    corners = positions(key)[: element.shape.corners]
    ends = {tuple(np.flatnonzero(weights).tolist()) for weights in element.weights if np.count_nonzero(weights) == 2}
    steps = np.arange(1, pieces)[:, None] / pieces
    at = [corners, *(corners[a] + steps * (corners[b] - corners[a]) for a, b in ends)]
    return mapped(key, nodes, np.concatenate(at))


def middles(key: str, nodes: Array) -> Array:
    """Where the middles of an element's sides are."""
    shape, corners = type_of(key).shape, positions(key)[: type_of(key).shape.corners]
    sides = shape.facets if shape.dimension == 3 else [range(shape.corners)]
    return mapped(key, nodes, np.array([corners[list(side)].mean(axis=0) for side in sides]))


def same(one: Array, other: Array) -> bool:
    """Whether points are the same, in any order."""
    far = np.linalg.norm(one[:, None] - other, axis=2)
    return one.shape == other.shape and bool(max(far.min(axis=0).max(), far.min(axis=1).max()) < 1e-11)


@every
def test_points_lie_on_the_curves_of_the_nodes(key: str) -> None:
    mesh, kind = bent(key), FAMILIES[key][0]
    quadratic, state = mesh.quadratic, drawn(mesh).states["a"]
    assert quadratic is not None
    inverted = summarise(mesh).inverted_elements
    assert len(inverted)
    (name,) = (name for name, rows in state.inverted.items() if len(rows))
    pieces = int(name.removeprefix(f"{kind}:"))
    assert 4 <= pieces <= 8
    shown = state.points[state.inverted[name]]
    assert len(shown) == len(inverted) == state.drawn
    for row, points in zip(inverted, shown, strict=True):
        nodes = mesh.points[quadratic.nodes[quadratic.offsets[row] : quadratic.offsets[row + 1]]]
        on_sides = middles(key, nodes)
        assert same(points[: -len(on_sides)], on_edges(key, nodes, pieces))
        if key not in HIGHER:  # there they are as the edges have them
            assert same(points[-len(on_sides) :], on_sides)
    what, corners = surface(name), ELEMENTS[kind].shape.corners
    assert what.corners == shown.shape[1]
    assert {edge[0] for edge in what.edges or ()} | {edge[-1] for edge in what.edges or ()} == set(range(corners))
    for edge in what.edges or ():  # from end to end, by short steps
        lengths = np.linalg.norm(np.diff(shown[:, edge], axis=1), axis=2)
        assert (lengths.max(axis=1) < 0.6 * lengths.sum(axis=1)).all()


def enclosed(points: Array, cells: Cells) -> float:
    """Area or volume within a boundary."""
    total = 0.0
    for name, rows in cells.items():
        for side in surface(name).sides if points.shape[1] == 3 else [(0, 1)]:
            for fan in ([side[0], *side[k : k + 2]] for k in range(1, len(side) - 1)) if len(side) > 2 else [side]:
                total += float(np.linalg.det(points[rows[:, fan]]).sum()) / math.factorial(points.shape[1])
    return total


@every
def test_a_curved_boundary_encloses_what_is_in_it(key: str) -> None:
    """As near as pieces come to curves; straight facets enclose 1."""
    mesh = bulging(key)
    assert mesh.quadratic is not None
    picture, measure = drawn(mesh), mesh.quadratic.judge(mesh.points, 1).measures.sum()
    assert set(picture.facets) - {"line"} <= {"triangle", "quad", "triangle/8", "quad/8", "triangle/6", "quad/6"}
    sides = {name: rows for name, rows in picture.facets.items() if mesh.dimension == 2 or name != "line"}
    assert abs(abs(enclosed(picture.boundary, sides)) - measure) < (0.35 if key in HIGHER else 0.3) * abs(1 - measure)


@every
def test_lines_between_neighbours_are_drawn_once(key: str) -> None:
    """All edges of all elements of a plane mesh, and of all facets of a solid."""
    mesh = bulging(key)
    picture = drawn(mesh)
    cells, points = picture.facets, picture.boundary
    if mesh.dimension == 2:
        cells, points = picture.states["a"].cells, picture.states["a"].points
    lines = cells["line"]
    assert (lines[:, 0] < lines[:, 1]).all()
    assert len(np.unique(lines, axis=0)) == len(lines)
    for name, rows in cells.items():
        if "/" in name:
            assert surface(name).edges == ()
            edges = surface(name.replace("/", ":")).edges or ()
            ends = np.concatenate([rows[:, pair] for edge in edges for pair in pairwise(edge)])
            assert {*map(tuple, np.sort(ends, axis=1).tolist())} <= {*map(tuple, lines.tolist())}
    assert len(points) > lines.max()


@every
def test_what_is_straight_is_drawn_as_ever(key: str) -> None:
    points, rows = straight(key)
    mesh = mesh_of(Quadratic([(key, rows)], len(points)), points, key, rows, np.zeros(len(points), dtype=bool))
    picture = drawn(mesh)
    assert set(picture.facets) <= {"line", "triangle", "quad"}
    assert len(picture.boundary) == mesh.topology.boundary.sum()
    assert set(picture.states["a"].cells) <= {FAMILIES[key][0]}


def test_what_is_curved_in_one_stage_has_the_same_rows_in_all() -> None:
    mesh = bent("triangle6")
    quadratic = mesh.quadratic
    assert quadratic is not None
    picture = drawn(mesh.with_points(quadratic.straight(mesh.points)), mesh)
    first, last = picture.states.values()
    assert first.cells is last.cells
    assert first.points.shape == last.points.shape
    lines = first.cells["line"]
    assert np.abs(first.points[lines] - last.points[lines]).max() > 0.1


def test_of_many_elements_the_straight_ones_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curves, "MOST", 3)
    assert set(drawn(bent("triangle6")).states["a"].cells) == {"triangle"}
