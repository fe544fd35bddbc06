"""Curved elements of third and higher order through the commands: judged, repaired, given way, and written back."""

from __future__ import annotations

import json
from pathlib import Path

import curved_bodies
import numpy as np
import pytest
from bent import HIGHER, curved, straight
from commands import error_line, run
from monomials import positions
from numpy.typing import NDArray
from programs import gmsh_session
from refined import refined
from written import by_gmsh, by_vtk

from meshfix_cli import read
from meshfix_cli.mesh.elements import element_of
from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.lagrange import Kind
from meshfix_cli.mesh.quadratic import Array
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.repair import Method

SOME = ("plate, 8 holes of 0.1", "ring 0.95", "wing 0.05", "cube, 1 bubbles of 0.1")


def lagrange_square(order: int) -> tuple[Array, NDArray[np.int32]]:
    """A straight quadrilateral of an order, its nodes in the order of VTK."""
    places = np.array(Kind("quad", order, True).places()) / order
    return places, np.arange(len(places), dtype=np.int32)[None]


def written(path: Path, key: str, points: Array) -> None:
    flat = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    (by_gmsh if path.suffix == ".msh" else by_vtk)(path, flat, [(key, straight(key)[1])])


@pytest.mark.parametrize(
    ("key", "suffix"),
    [*((key, ".vtu") for key in HIGHER), ("triangle15", ".vtk"), ("quad16", ".msh"), ("tetra20", ".msh")],
)
def test_a_curved_mesh_becomes_valid_and_only_its_nodes_move(tmp_path: Path, key: str, suffix: str) -> None:
    quadratic, points, free = curved(key, 0.3)
    source, target = tmp_path / f"in{suffix}", tmp_path / f"out{suffix}"
    written(source, key, points)
    before = json.loads(run("quality", source, "--json", "--all", code=3).stdout)
    judged = quadratic.judge(points, 1)
    assert before["inverted"] == (judged.verdicts != VALID).sum() > 0
    assert [one["id"] for one in before["first_inverted"]] == np.flatnonzero(judged.verdicts != VALID).tolist() or (
        suffix == ".msh"  # which numbers its elements
    )
    assert before["quality"]["mesh"]["curved"]["smallest"] == pytest.approx(judged.smallest.min())
    run("untangle", source, target)
    after = read(target)
    assert after.mesh.check()[0] == 0
    assert after.source.points[~free].tobytes() == read(source).source.points[~free].tobytes()
    assert (after.source.points != read(source).source.points).any()
    element = element_of(key)
    assert element is not None
    assert after.higher_order == {key: len(quadratic)}


@pytest.mark.parametrize("key", ["triangle10", "quad16", "tetra20", "hexahedron64"])
def test_the_boundary_gives_way_where_nothing_else_helps(tmp_path: Path, key: str) -> None:
    """Of one element the nodes of one edge lie far inside."""
    element = element_of(key)
    assert element is not None
    nodes = positions(key)
    corners = element.shape.corners
    edge = [i for i, weights in enumerate(element.weights, corners) if set(np.flatnonzero(weights)) == {0, 1}]
    assert len(edge) == 2
    nodes[edge, 1:] += 0.9
    path = tmp_path / "in.vtu"
    flat = np.column_stack([nodes, np.zeros((len(nodes), 3 - nodes.shape[1]))])
    by_vtk(path, flat, [(key, np.arange(len(nodes), dtype=np.int32)[None])])
    held = json.loads(run("untangle", "--json", path, tmp_path / "held.vtu", code=3).stdout)
    assert held["inverted"] == 1
    run("untangle", "--curving", "relax", path, tmp_path / "out.vtu")
    document = read(tmp_path / "out.vtu")
    assert document.mesh.check()[0] == 0
    moved = np.linalg.norm(document.mesh.points - nodes, axis=1)
    assert 0 < moved[edge].max() < 0.9 * np.sqrt(nodes.shape[1] - 1)
    assert not moved[:corners].any()


def test_meshes_around_round_things_become_valid_or_that_is_impossible(tmp_path: Path) -> None:
    seen = []
    with gmsh_session() as gmsh:
        for name in curved_bodies.made(
            gmsh, ("plate, 8 holes of 0.1", "ring 0.95", "wing 0.05", "cube, 1 bubbles of 0.1")
        ):
            gmsh.model.mesh.setOrder(3)
            gmsh.write(str(tmp_path / "mesh.msh"))
            _, tags, _ = gmsh.model.mesh.getElements(gmsh.model.getDimension())
            bounds = np.concatenate([gmsh.model.mesh.getElementQualities(some, "minDetJac") for some in tags])
            mesh = read(tmp_path / "mesh.msh").mesh
            assert mesh.check()[0] == (bounds <= 0).sum(), name
            outcome = Method().solve(mesh, float("inf"), 1)
            assert outcome.valid, name
            seen.append(int((bounds <= 0).sum()))
    assert min(seen) > 0


def test_elements_of_several_orders_do_not_part(tmp_path: Path) -> None:
    """Nodes between elements of second and of third order stay, though each side has its own."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    points, blocks = refined(corners, [("triangle", np.array([[0, 1, 2]], dtype=np.int32))], {"triangle": "triangle6"})
    count = len(points)
    points, more = refined(points, [("triangle", np.array([[0, 2, 3]], dtype=np.int32))], {"triangle": "triangle10"})
    inside = more[0][1][0, -1]
    points[inside] += [0.5, -0.5]
    assert count < inside
    path = tmp_path / "in.vtu"
    by_vtk(path, np.column_stack([points, np.zeros(len(points))]), [*blocks, *more])
    mesh = read(path).mesh
    assert mesh.quadratic is not None
    assert np.flatnonzero(mesh.quadratic.free).tolist() == [inside]
    run("untangle", path, tmp_path / "out.vtu")
    moved = (read(tmp_path / "out.vtu").mesh.points != mesh.points).any(axis=1)
    assert np.flatnonzero(moved).tolist() == [inside]


def test_types_that_are_not_judged_are_named(tmp_path: Path) -> None:
    """Elements of third order without nodes inside."""
    points, blocks = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float), []
    element = element_of("triangle9")
    assert element is not None
    nodes = np.concatenate([points, np.array(element.weights) @ points])
    nodes[4, 1] -= 0.1
    blocks.append(("triangle9", np.arange(9, dtype=np.int32)[None]))
    by_gmsh(tmp_path / "in.msh", nodes, blocks)
    assert "1 of 1 element is curved (triangles of 9 nodes)" in error_line("quality", tmp_path / "in.msh")


def test_nothing_is_proved_of_the_highest_orders(tmp_path: Path) -> None:
    """Rounding would have a part in it: the inner nodes have valid positions, as the straight element shows."""
    points, rows = lagrange_square(10)
    inside = np.asarray(((points > 0) & (points < 1)).all(axis=1))
    moved = points + inside[:, None] * np.random.default_rng(0).normal(0, 0.02, points.shape)
    by_vtk(tmp_path / "in.vtu", np.column_stack([moved, np.zeros(len(moved))]), [("quad121", rows)])
    found = read(tmp_path / "in.vtu").mesh
    assert found.check()[0] == 1
    assert not len(find_obstacles(found).inverted)


def test_a_node_far_away_is_refused_as_a_corner_is(tmp_path: Path) -> None:
    points, rows = lagrange_square(3)
    points[-1] = 1e300
    by_vtk(tmp_path / "in.vtu", np.column_stack([points, np.zeros(len(points))]), [("quad16", rows)])
    assert "coordinates beyond" in error_line("quality", tmp_path / "in.vtu")
