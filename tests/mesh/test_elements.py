"""The table of element types, against VTK and gmsh, and its facets and corners against the elements themselves."""

from __future__ import annotations

import numpy as np
import pytest
from isoparametric import REGULAR, regular, shape_functions
from programs import gmsh_session

from meshfix_cli.mesh.elements import ELEMENTS, SIMPLICES, Element, dimension_of

linear = pytest.mark.parametrize("element", [ELEMENTS[key] for key in REGULAR], ids=list(REGULAR))
KNOWN_TO_VTK = [element for element in ELEMENTS.values() if element.vtk is not None]
HIGHER = [element for element in ELEMENTS.values() if element.between]
KNOWN_TO_GMSH = [element for element in ELEMENTS.values() if element.gmsh is not None]


@linear
def test_facets_close_the_element_and_look_outwards(element: Element) -> None:
    points, shape = regular(element.key), element.shape
    assert points.shape == (shape.corners, shape.dimension)
    middle = points.mean(axis=0)
    for facet in shape.facets if shape.dimension > 1 else ():
        p = points[list(facet)]
        if shape.dimension == 2:
            normal = np.array([p[1, 1] - p[0, 1], p[0, 0] - p[1, 0]])
        else:
            normal = np.cross(p[1] - p[0], p[2] - p[0])
            np.testing.assert_allclose((p - p[0]) @ normal, 0, atol=1e-12)
        assert (p.mean(axis=0) - middle) @ normal > 0
    if shape.dimension == 3:  # each edge is passed once in each direction
        edges = [edge for facet in shape.facets for edge in zip(facet, (*facet[1:], facet[0]), strict=True)]
        assert sorted(edges) == sorted((b, a) for a, b in edges)
        assert len(set(edges)) == len(edges)
    if shape.dimension == 2:
        assert sorted(a for a, _ in shape.facets) == sorted(b for _, b in shape.facets) == list(range(shape.corners))


@linear
def test_corners_are_positive_and_of_weight_one(element: Element) -> None:
    points, shape = regular(element.key), element.shape
    assert {row[0] for row in shape.simplices} >= {0}
    for row in shape.simplices:
        p = points[list(row)]
        edges = p[1:] - p[0]
        unit = np.linalg.det(edges) / np.linalg.norm(edges, axis=1).prod()
        np.testing.assert_allclose(shape.weight * unit, 1.0)


def test_the_facet_of_a_simplex_is_opposite_the_node_of_its_number() -> None:
    for element in SIMPLICES.values():
        assert all(i not in facet for i, facet in enumerate(element.shape.facets))


@pytest.mark.parametrize("element", KNOWN_TO_VTK, ids=[element.key for element in KNOWN_TO_VTK])
def test_vtk_knows_the_type_by_its_number(element: Element) -> None:
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    cell = model.vtkGenericCell.InstantiateCell(element.vtk)
    assert cell.GetCellType() == element.vtk
    assert cell.GetCellDimension() == element.shape.dimension
    if element.nodes:
        assert cell.GetNumberOfPoints() == element.nodes
    if element.linear and element.key in REGULAR and element.shape.dimension == 3:
        for i in range(element.nodes):
            cell.GetPointIds().SetId(i, i)
        expected = []
        for i in range(cell.GetNumberOfFaces()):  # which are one object, filled anew
            ids = cell.GetFace(i).GetPointIds()
            expected.append([ids.GetId(k) for k in range(ids.GetNumberOfIds())])
        assert sorted(map(sorted, expected)) == sorted(map(sorted, element.shape.facets))


@pytest.mark.parametrize("element", HIGHER, ids=[element.key for element in HIGHER])
def test_nodes_lie_between_corners_where_vtk_and_gmsh_have_them(element: Element) -> None:
    corners, weights = element.shape.corners, np.array(element.weights)
    assert weights.shape == (element.nodes - corners, corners)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    if element.vtk is not None:
        model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
        values = model.vtkGenericCell.InstantiateCell(element.vtk).GetParametricCoords()
        places = np.array([values[i] for i in range(3 * element.nodes)]).reshape(-1, 3)
        # The parameters of VTK's pyramids are those of a box whose top is the apex, or places in the pyramid.
        known = shape_functions("pyramid", places[corners:]) if element.key == "pyramid13" else None
        if known is None:
            np.testing.assert_allclose(weights @ places[:corners], places[corners:], atol=1e-12)
        else:
            np.testing.assert_allclose(weights, known, atol=1e-12)
    if element.gmsh is not None:
        with gmsh_session() as gmsh:
            parameters = gmsh.model.mesh.getElementProperties(element.gmsh)[4]
        places = np.reshape(parameters, (element.nodes, -1))  # which have an order of their own
        between, others = weights @ places[:corners], places[corners:]
        apart = np.abs(between[:, None] - others).max(axis=2)
        assert (apart < 1e-6).sum(axis=0).tolist() == (apart < 1e-6).sum(axis=1).tolist() == [1] * len(others)


@pytest.mark.parametrize("element", HIGHER, ids=[element.key for element in HIGHER])
def test_a_turned_element_has_all_nodes_between_the_same_corners(element: Element) -> None:
    if element.shape.dimension < 2:
        return
    random = np.random.default_rng(3)
    corners = random.random((element.shape.corners, 3))
    nodes = np.concatenate([corners, np.array(element.weights) @ corners])
    turned = nodes[list(element.mirrored)]
    np.testing.assert_allclose(np.array(element.weights) @ turned[: len(corners)], turned[len(corners) :])
    assert element.mirrored[: len(corners)] == element.shape.mirrored
    assert sorted(element.mirrored) == list(range(element.nodes))
    assert element.straight is not None
    assert element.straight.nodes == len(corners)


@pytest.mark.parametrize("element", KNOWN_TO_GMSH, ids=[element.key for element in KNOWN_TO_GMSH])
def test_gmsh_knows_the_type_by_its_number(element: Element) -> None:
    with gmsh_session() as gmsh:
        _, dimension, _, nodes, places, corners = gmsh.model.mesh.getElementProperties(element.gmsh)
    assert (dimension, nodes, corners) == (element.shape.dimension, element.nodes, element.shape.corners)
    parameters = np.reshape(places, (nodes, -1))[: element.shape.corners]
    for row in element.shape.simplices:
        p = parameters[list(row)]
        assert np.linalg.det((p[1:] - p[0])[:, : dimension or 1]) > 0


def test_names_tell_the_dimension() -> None:
    expected = {
        "tetra35": 3,
        "VTK_LAGRANGE_WEDGE": 3,
        "penta_prism": 3,
        "hexahedron64": 3,
        "quad16": 2,
        "line5": 1,
        "vtk7": 0,
    }
    assert {name: dimension_of(name) for name in expected} == expected
    assert dimension_of("polyhedron") == 3
    assert dimension_of("line") == 1


def test_words() -> None:
    triangle, tetra = ELEMENTS["triangle"].shape, ELEMENTS["tetra"].shape
    assert (triangle.facet, triangle.measure, triangle.angle) == ("edge", "area", "angle")
    assert (tetra.facet, tetra.measure, tetra.angle) == ("triangle", "volume", "dihedral angle")
