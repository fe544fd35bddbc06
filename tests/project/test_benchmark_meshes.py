"""The meshes of every type of element that benchmarks and tests use are conforming, valid and positive."""

from __future__ import annotations

from collections import Counter
from functools import cache

import generate
import meshio
import numpy as np
import pytest
from building import Blocks, Points, inner_vertices
from elements import HOLES, MESHES, box_of_hexahedra, box_of_wedges_and_tets, tangles
from places import SAMPLES
from sampling import WEIGHTS, jacobians, measure, places

from meshfix_cli.mesh.elements import ELEMENTS

# Those of what they fill: of a disc or ball 1, less 1 for each hole through it, more 1 for one within.
EULER = {"quad rings": 0, "quad plate": -1, "hex plate": -1, "hex bracket": -1, "hex shell": 2, "wedge plate": -1}
TYPES = {
    "quads and triangles": {"quad", "triangle"},
    "wedges on tets": {"wedge", "tetra"},
    "wedges and tets": {"wedge", "tetra"},
    "hexes and wedges": {"hexahedron", "wedge"},
    "hexes beside tets": {"hexahedron", "pyramid", "tetra"},
    "tets within hexes": {"hexahedron", "pyramid", "tetra"},
    "every solid": {"hexahedron", "pyramid", "tetra", "wedge"},
}
every = pytest.mark.parametrize("name", MESHES)


@cache
def made(name: str) -> tuple[Points, Blocks]:
    return MESHES[name]()


def faces(cells: Blocks, dimension: int) -> Counter[tuple[int, ...]]:
    """How often each facet stands in an element, by its nodes from the lowest on in the direction seen from outside."""
    found: Counter[tuple[int, ...]] = Counter()
    for key, rows in cells:
        for facet in ELEMENTS[key].shape.facets:
            for row in rows[:, facet].tolist():
                first = row.index(min(row)) if dimension == 3 else 0
                found[tuple(row[first:] + row[:first])] += 1
    return found


def other_way_round(facet: tuple[int, ...]) -> tuple[int, ...]:
    return (facet[0], *facet[:0:-1]) if len(facet) > 2 else facet[::-1]


def sides(facet: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(zip(facet, (*facet[1:], facet[0]), strict=True))


@every
def test_elements_are_valid_at_all_of_their_points(name: str) -> None:
    points, cells = made(name)
    assert all((jacobians(points, key, rows) > 0).all() for key, rows in cells)


@every
def test_what_is_shared_is_seen_from_both_sides(name: str) -> None:
    points, cells = made(name)
    found = faces(cells, points.shape[1])
    assert set(found.values()) == {1}
    outer = [facet for facet in found if other_way_round(facet) not in found]
    if points.shape[1] == 3:
        ends = Counter(side for facet in outer for side in sides(facet))
        assert set(ends.values()) == {1}
        assert all((b, a) in ends for a, b in ends)
    else:
        assert sorted(a for a, _ in outer) == sorted(b for _, b in outer) == sorted({a for a, _ in outer})
    held = ~inner_vertices(len(points), cells)
    assert set(np.flatnonzero(held).tolist()) == {vertex for facet in outer for vertex in facet}


@every
def test_no_gap_is_left(name: str) -> None:
    """A quad beside two triangles, or two cuts of one side that cross, enclose nothing: a hole that Euler counts."""
    points, cells = made(name)
    found = {frozenset(facet) for facet in faces(cells, points.shape[1])}
    sizes = [len(points), len(found)]
    if points.shape[1] == 3:
        directed = faces(cells, 3)
        sizes.insert(1, len({frozenset(side) for facet in directed for side in sides(facet)}))
    sizes.append(sum(len(rows) for _, rows in cells))
    assert sum((-1) ** k * size for k, size in enumerate(sizes)) == EULER.get(name, 1)


@every
def test_counts_and_types(name: str) -> None:
    points, cells = made(name)
    assert 300 <= sum(len(rows) for _, rows in cells) <= 3000
    kind = {"quad": "quad", "hex": "hexahedron", "wedge": "wedge"}
    alone = {kind[word] for word in kind if word in name}
    assert {key for key, _ in cells} == TYPES.get(name, alone)
    assert len({key for key, _ in cells}) == len(cells)
    assert all(rows.shape == (len(rows), ELEMENTS[key].nodes) and rows.dtype == np.int32 for key, rows in cells)
    used = np.unique(np.concatenate([rows.ravel() for _, rows in cells]))
    assert used.tolist() == list(range(len(points)))
    assert len(np.unique(points, axis=0)) == len(points)
    assert 0.05 < inner_vertices(len(points), cells).mean() < 1


def plate_area(h: float) -> float:
    """That of the sample plate, whose holes are regular polygons."""
    corners = [(radius, max(8, round(2 * np.pi * radius / h))) for _, _, radius in generate.HOLES]
    return 6 - sum(count / 2 * np.sin(2 * np.pi / count) * radius**2 for radius, count in corners)


SIZES = {
    "graded quads": 1.0,
    "quad rings": 30 * np.sin(np.pi / 30) * (16 - 1),
    "quad plate": plate_area(0.13),
    "quads and triangles": 9.0,
    "hex box": 1.0,
    "graded hexes": 1.0,
    "hex plate": 0.8 * plate_area(0.3),
    "hexes of tets": 1.2,
    "wedge plate": 0.8 * plate_area(0.2),
    "wedges on tets": 0.8,
    "wedges and tets": 1.0,
    "hexes and wedges": 0.5 * 9,
    "hexes beside tets": 36.0,
    "tets within hexes": 1.0,
}


@pytest.mark.parametrize("name", SIZES)
def test_they_fill_what_they_are_made_for(name: str) -> None:
    points, cells = made(name)
    np.testing.assert_allclose(sum(measure(points, key, rows) for key, rows in cells), SIZES[name])


def test_boxes_of_many() -> None:
    """The benchmarks ask for a million."""
    _, cells = box_of_hexahedra(20_000)
    assert [(key, len(rows)) for key, rows in cells] == [("hexahedron", 27**3)]
    points, cells = box_of_wedges_and_tets(20_000)
    counts = {key: len(rows) for key, rows in cells}
    assert counts.keys() == {"wedge", "tetra"}
    assert sum(counts.values()) == pytest.approx(20_000, rel=0.05)
    assert counts["wedge"] == pytest.approx(counts["tetra"], rel=0.2)
    assert all((jacobians(points, key, rows, 1) > 0).all() for key, rows in cells)


@every
def test_tangles_move_what_is_free_and_invert_some(name: str) -> None:
    points, cells = made(name)
    free = inner_vertices(len(points), cells)
    tangled = tangles(name, points, free, 0.1)
    assert len(tangled) == (4 if name in HOLES else 3)
    again = tangles(name, points, free, 0.1)
    assert all(np.array_equal(moved, again[how]) for how, moved in tangled.items())
    for how, moved in tangled.items():
        changed = (moved != points).any(axis=1)
        assert not (changed & ~free).any() or how == "hole turned by 20°"
        smallest = [jacobians(moved, key, rows, 1).min() for key, rows in cells]
        assert min(smallest) <= 0
    steps = np.linalg.norm(tangled["P=25 D=2h"] - points, axis=1)
    assert (steps > 0).sum() == min(round(0.25 * len(points)), free.sum())
    np.testing.assert_allclose(steps[steps > 0], 0.2)
    np.testing.assert_allclose(np.linalg.norm(tangled["P=100 D=8h"] - points, axis=1)[free], 0.8)
    assert len(np.unique(tangled["collapsed"][free], axis=0)) == 1


@pytest.mark.parametrize("name", HOLES)
def test_a_turned_hole_has_a_valid_mesh_around_it(name: str) -> None:
    """What is near is turned with it, and less and less outwards."""
    points, cells = made(name)
    free, hole = inner_vertices(len(points), cells), HOLES[name](points)
    target = tangles(name, points, free, 0.1)["hole turned by 20°"]
    assert hole.sum() >= 8
    assert not free[hole].any()
    assert np.array_equal((target != points).any(axis=1), hole)
    middle, room = points[hole].mean(axis=0), {"quad rings": 4.0, "quad plate": 0.7, "hex shell": 1.0}[name]
    radius = np.linalg.norm(points - middle, axis=1)
    share = np.clip((room - radius) / (room - radius[hole].max()), 0, 1)
    around = (points - middle)[:, :2] @ (1, 1j) * np.exp(1j * np.radians(20) * share)
    solution = points.copy()
    solution[:, :2] = middle[:2] + np.column_stack([around.real, around.imag])
    np.testing.assert_allclose(solution[~free], target[~free], atol=1e-12)
    assert all((jacobians(solution, key, rows) > 0).all() for key, rows in cells)


@pytest.mark.parametrize(
    ("sample", "types"),
    [
        ("quads_tangled.vtk", {"quad"}),
        ("hexes_tangled.inp", {"hexahedron"}),
        ("mixed_tangled.msh", {"hexahedron", "pyramid", "tetra"}),
    ],
)
def test_in_samples_some_of_each_type_are_inverted_and_all_can_be_moved(sample: str, types: set[str]) -> None:
    """As meshio reads them."""
    mesh = meshio.read(SAMPLES / sample)
    dimension = 2 if types == {"quad"} else 3
    points, cells = mesh.points[:, :dimension], [(block.type, block.data.astype(np.int32)) for block in mesh.cells]
    assert {key for key, _ in cells} == types
    free = inner_vertices(len(points), cells)
    for key, rows in cells:
        valid = (jacobians(points, key, rows) > 0).all(axis=1)
        assert 0.03 < (~valid).mean() < 0.9
        assert free[rows[~valid]].any(axis=1).all()
    assert (SAMPLES / sample).stat().st_size < 1e5


@pytest.mark.parametrize("key", WEIGHTS)
def test_the_weights_are_those_of_vtk(key: str) -> None:
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    cell = model.vtkGenericCell.InstantiateCell(ELEMENTS[key].vtk)
    for place in places(key, 3):
        weights = [0.0] * ELEMENTS[key].nodes
        cell.InterpolateFunctions([*place, 0.0][:3], weights)
        np.testing.assert_allclose(WEIGHTS[key](*place), weights, atol=1e-14)
