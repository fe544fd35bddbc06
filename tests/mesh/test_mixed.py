"""Meshes of elements of any types: their facets, orientation, boundary and interfaces."""

from __future__ import annotations

import numpy as np
import pytest
from elements import MESHES
from isoparametric import REGULAR
from numpy.typing import NDArray
from sampling import jacobians, measure

from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import JUDGED
from meshfix_cli.mesh.judged import CORNER, INSIDE, VALID, Judged
from meshfix_cli.mesh.mesh import Mesh

every = pytest.mark.parametrize("name", sorted(MESHES))
Blocks = list[tuple[str, NDArray[np.int32]]]


def faces_of(blocks: Blocks) -> dict[frozenset[int], list[int]]:
    """The elements at each facet, by sets of vertices."""
    found: dict[frozenset[int], list[int]] = {}
    row = 0
    shapes = {element.key: element.shape for element in JUDGED}
    for key, rows in blocks:
        for element in rows.tolist():
            for facet in shapes[key].facets:
                found.setdefault(frozenset(element[i] for i in facet), []).append(row)
            row += 1
    return found


def mirrored(blocks: Blocks, chosen: NDArray[np.bool_]) -> Blocks:
    """The same with some elements numbered the other way round."""
    orders = {
        "triangle": [1, 0, 2], "quad": [0, 3, 2, 1], "tetra": [1, 0, 2, 3], "pyramid": [0, 3, 2, 1, 4],
        "wedge": [0, 2, 1, 3, 5, 4], "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5],
    }  # fmt: skip
    result, before = [], 0
    for key, rows in blocks:
        here = chosen[before : before + len(rows), None]
        result.append((key, np.where(here, rows[:, orders[key]], rows)))
        before += len(rows)
    return result


@every
def test_facets_boundary_and_interfaces_are_those_of_sets_of_vertices(name: str) -> None:
    points, blocks = MESHES[name]()
    mesh, faces = Mesh.build(points, blocks), faces_of(blocks)
    outer = {vertex for facet, owners in faces.items() if len(owners) == 1 for vertex in facet}
    assert set(np.flatnonzero(mesh.topology.boundary).tolist()) == outer
    labels = np.arange(mesh.topology.m) * 3 // mesh.topology.m
    between = {v for facet, owners in faces.items() if len({labels[e] for e in owners}) == 2 for v in facet}
    assert set(np.flatnonzero(mesh.topology.interface(labels)).tolist()) == between
    assert mesh.check()[0] == 0
    assert not mesh.topology.flipped.any()
    assert not mesh.topology.component.any()


@every
def test_whatever_way_elements_are_numbered_they_become_positive(name: str, random: np.random.Generator) -> None:
    points, blocks = MESHES[name]()
    chosen = random.uniform(size=sum(len(rows) for _, rows in blocks)) < 0.3
    mesh = Mesh.build(points, mirrored(blocks, chosen))
    np.testing.assert_array_equal(mesh.topology.flipped, chosen)
    np.testing.assert_array_equal(mesh.topology.misnumbered, chosen)
    assert mesh.check()[0] == 0
    assert (mesh.topology.stars().facet_mates >= 0).sum() == 2 * sum(len(o) == 2 for o in faces_of(blocks).values())
    reflected = Mesh.build(points * ([-1] + [1] * (points.shape[1] - 1)), blocks)
    assert reflected.topology.flipped.all()
    assert not reflected.topology.misnumbered.any()


def test_a_type_that_a_file_numbers_the_other_way_throughout_is_a_convention() -> None:
    points, blocks = MESHES["hexes and wedges"]()
    wedges = np.concatenate([np.full(len(rows), key == "wedge") for key, rows in blocks])
    mesh = Mesh.build(points, mirrored(blocks, wedges))
    np.testing.assert_array_equal(mesh.topology.flipped, wedges)
    assert not mesh.topology.misnumbered.any()
    wedges[np.argmax(wedges)] = False
    assert Mesh.build(points, mirrored(blocks, wedges)).topology.misnumbered.any()


@every
def test_measures_add_up_and_blocks_are_the_elements(name: str) -> None:
    points, blocks = MESHES[name]()
    mesh = Mesh.build(points, blocks)
    measures = mesh.topology.of_rows(Judged(mesh.topology.connectivity).judge(mesh.along_curve(points), 1)[1])
    for block in mesh.topology.blocks:
        rows = np.concatenate([rows for key, rows in blocks if key == block.element.key])
        expected = measure(points, block.element.key, rows)
        np.testing.assert_allclose(measures[block.rows].sum(), expected, rtol=1e-9)
        np.testing.assert_array_equal(block.vertices, rows)


def test_a_quadrilateral_against_two_triangles_has_no_mate() -> None:
    """A cube on whose top stands the apex of two tets: their triangles are not the face."""
    points = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)] + [[0.5, 0.5, 2]], dtype=float)
    cube, tets = np.array([[0, 1, 3, 2, 4, 5, 7, 6]]), np.array([[4, 5, 7, 8], [4, 7, 6, 8]])
    mesh = Mesh.build(points, [("hexahedron", cube), ("tetra", tets)])
    assert mesh.topology.boundary.all()
    assert mesh.topology.component.tolist() == [0, 1, 1]
    assert mesh.check()[0] == 0


def test_a_hexahedron_that_is_invalid_inside_only_is_told(random: np.random.Generator) -> None:
    """Its corners are positive, and some place inside is not."""
    cube = np.array(REGULAR["hexahedron"], dtype=float)
    connectivity = Mesh.build(cube, [("hexahedron", np.arange(8)[None])]).topology.connectivity
    found = set()
    for _ in range(3000):
        nodes = cube + random.normal(scale=0.3, size=cube.shape)
        (verdict,) = Judged(connectivity).judge(nodes, 1)[0]
        found.add(int(verdict))
        if verdict == INSIDE:
            assert (np.linalg.det(_corner_edges(nodes)) > 0).all()
            assert jacobians(nodes, "hexahedron", np.arange(8, dtype=np.int32)[None], steps=15).min() <= 0
    assert found == {VALID, INSIDE, CORNER}


def _corner_edges(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    rows = np.array(JUDGED[-1].shape.simplices)
    return nodes[rows[:, 1:]] - nodes[rows[:, :1]]


def test_what_cannot_be_built_is_refused_in_one_line() -> None:
    points, blocks = MESHES["hex box"]()
    rows = dict(blocks)["hexahedron"]
    bad = rows.copy()
    bad[5, 0] = len(points)
    with pytest.raises(InvalidMeshError, match=r"element 5 refers to vertices \[.*\], but there are"):
        Mesh.build(points, [("hexahedron", bad)])
    bad[5, 0] = bad[5, 1]
    with pytest.raises(InvalidMeshError, match="element 5 names a vertex twice"):
        Mesh.build(points, [("hexahedron", bad)])
    with pytest.raises(InvalidMeshError, match="hexahedron are not solved for in 2 dimensions"):
        Mesh.build(points[:, :2], [("hexahedron", rows)])
    with pytest.raises(InvalidMeshError, match=r"\(m, 8\) integers are needed"):
        Mesh.build(points, [("hexahedron", rows[:, :6])])
    with pytest.raises(InvalidMeshError, match="more than two elements share the face"):
        third = rows[:1].copy()
        third[0, [0, 3, 4, 7]] = [len(points) - 1 - i for i in range(4)]
        Mesh.build(points, [("hexahedron", np.concatenate([rows, third]))])
    twice = Mesh.build(points, [("hexahedron", np.concatenate([rows, rows[3:4]]))])
    assert twice.topology.source.tolist() == list(range(len(rows)))


@every
def test_the_mean_edge_length_is_that_of_the_distinct_edges(name: str) -> None:
    points, blocks = MESHES[name]()
    shapes = {element.key: element.shape for element in JUDGED}
    edges = {
        tuple(sorted((row[a], row[b])))
        for key, rows in blocks for row in rows.tolist() for group in shapes[key].parallel for a, b in group
    }  # fmt: skip
    ends = np.array(sorted(edges))
    expected = np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1).mean()
    np.testing.assert_allclose(Mesh.build(points, blocks).mean_edge_length(), expected, rtol=1e-12)


@every
def test_the_edge_length_of_the_boundary_is_that_of_its_facets_wherever_the_inside_is(name: str) -> None:
    points, blocks = MESHES[name]()
    shapes = {element.key: element.shape for element in JUDGED}
    alone = {facet for facet, owners in faces_of(blocks).items() if len(owners) == 1}
    facets = [[row[i] for i in one] for key, rows in blocks for row in rows.tolist() for one in shapes[key].facets]
    sides = [side for one in facets if frozenset(one) in alone for side in zip(one, [*one[1:], one[0]], strict=True)]
    start, end = np.array(sides).T
    mesh = Mesh.build(points, blocks)
    expected = np.linalg.norm(points[end] - points[start], axis=1).mean()
    assert mesh.boundary_edge_length() == pytest.approx(expected, rel=1e-12)
    moved = mesh.with_points(np.where(mesh.movable[:, None], points + 1.0, points))
    assert moved.boundary_edge_length() == mesh.boundary_edge_length()
