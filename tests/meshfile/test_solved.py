"""What cells are solved as: against the volumes that gmsh integrates, and the triangles and boxes of VTK."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from programs import gmsh_session

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, JUDGED
from meshfix_cli.meshfile.solved import Solved, in_common_types, solved_of, solved_runs, turned
from meshfix_cli.meshfile.source import Cells

CORNERS = {
    "quad": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "tetra": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "pyramid": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]],
    "wedge": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    "hexahedron": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
}
COLLAPSED = [  # as LS-DYNA, Abaqus and Ansys have them
    ("hexahedron", [0, 1, 2, 2, 4, 5, 6, 6], "wedge"),
    ("hexahedron", [0, 1, 2, 3, 4, 4, 6, 6], "wedge"),
    ("hexahedron", [0, 0, 2, 3, 4, 4, 6, 7], "wedge"),
    ("hexahedron", [0, 1, 2, 3, 0, 1, 6, 7], "wedge"),
    ("hexahedron", [0, 1, 2, 3, 4, 4, 4, 4], "pyramid"),
    ("hexahedron", [0, 0, 0, 0, 4, 5, 6, 7], "pyramid"),
    ("hexahedron", [0, 1, 2, 2, 4, 4, 4, 4], "tetra"),
    ("hexahedron", [0, 1, 2, 0, 4, 4, 4, 4], "tetra"),
    ("hexahedron", [0, 1, 2, 2, 0, 1, 6, 6], "tetra"),
    ("wedge", [0, 1, 2, 0, 4, 5], "pyramid"),
    ("wedge", [0, 1, 2, 3, 3, 3], "tetra"),
    ("wedge", [0, 1, 2, 0, 1, 5], "tetra"),
    ("pyramid", [0, 1, 2, 2, 4], "tetra"),
    ("pyramid", [0, 1, 1, 3, 4], "tetra"),
    ("quad", [0, 1, 2, 2], "triangle"),
    ("quad", [0, 0, 2, 3], "triangle"),
    ("quad", [0, 1, 2, 0], "triangle"),
]


def sizes(points: NDArray[np.float64], key: str, rows: NDArray[Any]) -> NDArray[np.float64]:
    """The signed areas of polygons, or volumes, as gmsh integrates the determinants of their Jacobians."""
    if ELEMENTS[key].shape.dimension == 2:
        (x, y), (u, v) = (np.moveaxis(points[some, :2], 2, 0) for some in (rows, np.roll(rows, -1, axis=1)))
        return np.asarray((x * v - u * y).sum(axis=1) / 2)
    with gmsh_session() as gmsh:
        element = ELEMENTS[key]
        tag = gmsh.model.addDiscreteEntity(element.shape.dimension)
        gmsh.model.mesh.addNodes(element.shape.dimension, tag, np.arange(1, len(points) + 1), points.ravel())
        gmsh.model.mesh.addElementsByType(tag, element.gmsh, [], (rows + 1).ravel())
        local, weights = gmsh.model.mesh.getIntegrationPoints(element.gmsh, "Gauss6")
        determinants = gmsh.model.mesh.getJacobians(element.gmsh, local)[1]
    return np.asarray(determinants.reshape(len(rows), -1) @ weights)


def geometry(key: str, seed: int) -> NDArray[np.float64]:
    random = np.random.default_rng(seed)
    points = np.array(CORNERS[key], dtype=float)
    return points + random.uniform(-0.3, 0.3, points.shape)


def only(solved: Solved) -> tuple[str, NDArray[Any]]:
    (part,) = solved.parts
    return part.key, part.vertices


@pytest.mark.parametrize(("key", "pattern", "expected"), COLLAPSED)
def test_a_collapsed_element_is_what_is_left_of_it(key: str, pattern: list[int], expected: str) -> None:
    points = geometry(key, 1)
    found, rows = only(solved_of([Cells(key, np.array([pattern]))]))
    assert found == expected
    np.testing.assert_allclose(sizes(points, found, rows), sizes(points, key, np.array([pattern])), atol=1e-13)


@pytest.mark.parametrize("key", CORNERS)
def test_however_an_element_collapses_its_size_stays(key: str) -> None:
    """All ways to let nodes be others, of hexahedra a part: what is then of a type has the size of the collapsed."""
    n = ELEMENTS[key].nodes
    points = geometry(key, 2)
    patterns: list[tuple[int, ...]] = [()]
    for i in range(n):
        patterns = [(*row, value) for row in patterns for value in {*row, i}]
    kept: dict[str, list[tuple[tuple[int, ...], list[int]]]] = {}
    for pattern in [tuple(range(n)), *patterns[:: 3 if n == 8 else 1]]:
        for part in solved_of([Cells(key, np.array([pattern]))]).parts:
            kept.setdefault(part.key, []).append((pattern, part.vertices[0].tolist()))
    dimension = ELEMENTS[key].shape.dimension
    assert kept.keys() == {one.key for one in JUDGED if one.shape.dimension == dimension and one.nodes <= n}
    for found, pairs in kept.items():
        before, after = (np.array(rows) for rows in zip(*pairs, strict=True))
        np.testing.assert_allclose(sizes(points, found, after), sizes(points, key, before), atol=1e-12)


def test_what_is_nothing_is_held() -> None:
    rows = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [0, 1, 2, 3, 0, 1, 2, 3]])
    solved = solved_of([Cells("hexahedron", rows, np.array([11, 12]))])
    assert (solved.m, solved.not_judged()) == (1, {"collapsed_hexahedron": 1})
    quads = [Cells("line", np.array([[0, 1]])), Cells("quad", rows[:, :4]), Cells("quad", rows[:1, [0, 1, 0, 2]])]
    assert solved_of(quads).not_judged() == {"collapsed_quadrilateral": 1}
    triangles = solved_of([Cells("triangle", np.array([[0, 1, 1], [0, 1, 2]]))])
    assert (triangles.blocks.tolist(), triangles.not_judged()) == ([[0, 1, 2]], {"collapsed_triangle": 1})


def test_a_collapsed_element_holds_its_other_nodes_too() -> None:
    rows = np.array([[0, 1, 2, 3, 4, 5], [0, 0, 1, 7, 4, 7], [6, 6, 6, 8, 8, 8]])
    solved = solved_of([Cells("triangle6", rows)])
    assert (solved.m, solved.not_judged()) == (1, {"collapsed_triangle": 2})
    assert sorted(row for run in solved.rest for row in run.vertices.tolist()) == rows[1:].tolist()


def test_what_is_of_no_type_is_held() -> None:
    """A hexahedron that has lost one edge has seven corners."""
    rows = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [0, 1, 2, 2, 4, 5, 6, 7], [0, 1, 2, 2, 4, 5, 6, 6]])
    solved = solved_of([Cells("hexahedron", rows)])
    assert [part.key for part in solved.parts] == ["hexahedron", "wedge"]
    assert solved.not_judged() == {"collapsed_hexahedron": 1}
    assert solved.rest[-1].vertices.tolist() == [[0, 1, 2, 4, 5, 6, 7]]


def test_elements_know_their_cells_and_numbers() -> None:
    """Those of several types in one run, and strips, of which a cell is several elements."""
    hexahedra = np.array([[0, 1, 2, 2, 4, 5, 6, 6], [0, 1, 2, 3, 4, 5, 6, 7], [0, 1, 2, 2, 4, 4, 4, 4]])
    cells = [Cells("triangle", np.array([[0, 1, 2]])), Cells("tetra", np.array([[0, 1, 2, 4]])),
             Cells("tetra_of_20", np.arange(20)[None]), Cells("hexahedron", hexahedra)]  # fmt: skip
    solved = solved_of(cells)
    assert [part.key for part in solved.parts] == ["tetra", "hexahedron", "tetra", "wedge"]
    numbers = [np.array([7]), np.array([1]), np.array([3]), np.array([30, 31, 32])]
    assert solved.of_elements(numbers).tolist() == [1, 31, 32, 30]
    assert solved.not_judged() == {"tetra_of_20": 1}
    assert [run.type for run in solved.rest] == ["triangle", "tetra_of_20"]
    assert [(part.key, len(part.vertices)) for part in solved.some(np.array([0, 1, 2]))] == [
        ("tetra", 1), ("hexahedron", 1), ("tetra", 1), ("wedge", 0),
    ]  # fmt: skip
    strips = solved_of([Cells("triangle_strip", np.array([[0, 1, 2, 3], [4, 5, 6, 7]]))])
    assert strips.of_elements([np.array([5, 9])]).tolist() == [5, 5, 9, 9]


def test_simplices_alone_stay_an_array() -> None:
    rows = np.array([[0, 1, 2], [2, 1, 3]])
    assert solved_of([Cells("line", rows[:, :2]), Cells("triangle", rows)]).blocks is rows
    assert solved_of([Cells("triangle", rows), Cells("triangle", rows)]).blocks.tolist() == [*rows.tolist()] * 2
    quads = solved_of([Cells("quad", np.array([[0, 1, 2, 2]]))])
    assert quads.blocks.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("types", "expected"),
    [
        (["line", "triangle", "tetra"], [2]), (["quad", "triangle"], [0, 1]), (["tetra10", "triangle"], [0]),
        (["polyhedron", "hexahedron"], [1]), (["polygon"], []), (["voxel", "pixel"], [0]), ([], []),
    ],
)  # fmt: skip
def test_what_is_solved_is_of_the_highest_dimension(types: list[str], expected: list[int]) -> None:
    cells = [Cells(one, np.zeros((1, ELEMENTS[one].nodes or 4), dtype=int)) for one in types]
    assert solved_runs(cells) == expected


@pytest.mark.parametrize("size", [3, 4, 9])
def test_strips_are_the_triangles_of_vtk(size: int) -> None:
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    from vtkmodules.vtkCommonCore import vtkIdList

    ids = vtkIdList()
    for i in range(size):
        ids.InsertNextId(10 + i)
    polygons = model.vtkCellArray()
    model.vtkTriangleStrip.DecomposeStrip(size, [10 + i for i in range(size)], polygons)
    expected = []
    for i in range(polygons.GetNumberOfCells()):
        polygons.GetCellAtId(i, ids)
        expected.append([ids.GetId(k) for k in range(3)])
    _, rows = only(solved_of([Cells("triangle_strip", 10 + np.arange(size)[None])]))
    assert [np.roll(row, -row.argmin()).tolist() for row in rows] == [
        np.roll(row, -np.argmin(row)).tolist() for row in expected
    ]


def test_a_strip_may_turn_by_a_vertex_that_it_names_twice() -> None:
    solved = solved_of([Cells("triangle_strip", np.array([[0, 1, 2, 2, 3, 4]]))])
    assert only(solved)[1].tolist() == [[0, 1, 2], [2, 4, 3]]


@pytest.mark.parametrize("key", ["pixel", "voxel"])
def test_pixels_and_voxels_are_the_boxes_of_vtk(key: str) -> None:
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    image = model.vtkImageData()
    image.SetDimensions(3, 2, 2 if key == "voxel" else 1)
    image.SetSpacing(0.5, 2.0, 3.0)
    cells = [image.GetCell(i) for i in range(1)]
    assert cells[0].GetCellType() == ELEMENTS[key].vtk
    rows = np.array([[cells[0].GetPointId(k) for k in range(cells[0].GetNumberOfPoints())]])
    points = np.array([image.GetPoint(i) for i in range(image.GetNumberOfPoints())])
    found, vertices = only(solved_of([Cells(key, rows)]))
    size = 3.0 if key == "voxel" else 1.0
    np.testing.assert_allclose(sizes(points, found, vertices), size)
    other = turned([Cells(key, rows)], {0: np.array([0])})[0]
    back = in_common_types(Cells(key, rows[:, other.order]))
    np.testing.assert_allclose(sizes(points, back.type, back.vertices), -size)


@pytest.mark.parametrize("element", JUDGED, ids=[element.key for element in JUDGED])
def test_a_turned_element_has_the_negative_size(element: Any) -> None:
    points = np.random.default_rng(4).random((element.nodes, element.shape.dimension))
    rows = np.arange(element.nodes)[None]
    order = turned([Cells(element.key, rows)], {0: np.array([0])})[0].order
    before, after = (sizes(points, element.key, some) for some in (rows, rows[:, list(order)]))
    np.testing.assert_allclose(after, -before, atol=1e-14)
    facets = [tuple(order.index(node) for node in facet) for facet in element.shape.facets]
    smallest = [min(facet[i:] + facet[:i] for i in range(len(facet))) for facet in facets]
    wanted = [facet[::-1] for facet in element.shape.facets]
    assert sorted(smallest) == sorted(min(facet[i:] + facet[:i] for i in range(len(facet))) for facet in wanted)
    # Which rows of a group are numbered the same way round.
    odd = Solved(solved_of([Cells(element.key, np.concatenate([rows, rows[:, list(order)]]))]).parts, ()).odd()
    assert odd[0] != odd[1]


def test_repetitions_have_one_number() -> None:
    quads = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [2, 3, 0, 1], [3, 2, 1, 0]])
    solved = solved_of([Cells("triangle", np.array([[0, 1, 2]])), Cells("quad", quads)])
    groups = solved.groups()
    assert groups[1] == groups[3] == groups[4]
    assert len({groups[0], groups[1], groups[2]}) == 3
    odd = solved.odd()
    assert odd[1] == odd[3]
    assert odd[1] != odd[4]


def test_strips_cannot_be_turned() -> None:
    with pytest.raises(ReadError, match="strips of triangles"):
        turned([Cells("triangle_strip", np.array([[0, 1, 2, 3]]))], {0: np.array([0])})
