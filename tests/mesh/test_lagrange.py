"""Places of the nodes of elements of any order, against gmsh and VTK, which tell them or make them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from programs import gmsh_session

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.lagrange import kinds, lattice
from meshfix_cli.meshfile.gmsh.cells import TYPES

FAMILIES = ["line", "triangle", "quad", "tetra", "pyramid", "wedge", "hexahedron"]
OF_VTK = {68: "line", 69: "triangle", 70: "quad", 71: "tetra", 72: "hexahedron", 73: "wedge"}


def test_gmsh_has_its_nodes_there() -> None:
    """It tells those of all types but wedges, in elements between -1 and 1; the apex of pyramids is in their middle."""
    numbers = {key: number for number, (key, _) in TYPES.items()}
    with gmsh_session() as gmsh:
        for key, kind in kinds().items():
            if kind.family == "wedge" or key not in numbers:
                continue
            places = np.array(kind.places("gmsh")) / kind.order
            if kind.family in ("line", "quad", "hexahedron"):
                places = 2 * places - 1
            if kind.family == "pyramid":
                places[:, :2] = 2 * places[:, :2] - 1 + places[:, 2:]
            _, d, order, count, local, _ = gmsh.model.mesh.getElementProperties(numbers[key])
            assert order == kind.order
            np.testing.assert_allclose(places, np.reshape(local, (count, -1))[:, :d], atol=1e-12, err_msg=key)


@pytest.mark.parametrize("order", [2, 3, 4, 6])
def test_gmsh_makes_wedges_with_its_nodes_there(order: int) -> None:
    corners = lattice("wedge", 1)
    with gmsh_session() as gmsh:
        gmsh.model.addDiscreteEntity(3, 1)
        gmsh.model.mesh.addNodes(3, 1, range(1, 7), np.ravel(corners))
        gmsh.model.mesh.addElementsByType(1, 6, [], range(1, 7))
        gmsh.model.mesh.setOrder(order)
        tags, places, _ = gmsh.model.mesh.getNodes()
        (nodes,) = gmsh.model.mesh.getElements(3)[2]
    rows = np.argsort(tags)[np.searchsorted(np.sort(tags), nodes)]
    np.testing.assert_allclose(places.reshape(-1, 3)[rows] * order, lattice("wedge", order), atol=1e-12)


@pytest.mark.parametrize("number", OF_VTK)
def test_vtk_has_its_nodes_there(number: int) -> None:
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    family = OF_VTK[number]
    for order in range(2, 8):
        expected = np.array(lattice(family, order, "vtk"))
        cell = model.vtkGenericCell.InstantiateCell(number)
        cell.GetPoints().SetNumberOfPoints(len(expected))
        cell.GetPointIds().SetNumberOfIds(len(expected))
        for i in range(len(expected)):
            cell.GetPoints().SetPoint(i, 0, 0, 0)
        if hasattr(cell, "SetUniformOrderFromNumPoints"):
            cell.SetUniformOrderFromNumPoints(len(expected))
        cell.Initialize()
        values = cell.GetParametricCoords()
        places = np.array([values[i] for i in range(3 * len(expected))]).reshape(-1, 3)
        np.testing.assert_allclose(order * places[:, : expected.shape[1]], expected, atol=1e-12)


@pytest.mark.parametrize("family", FAMILIES)
def test_weights_are_those_of_a_straight_element(family: str) -> None:
    """They give back the places from the corners, and are not negative."""
    for kind in (one for one in kinds().values() if one.family == family and one.order < 6):
        places, weights = np.array(kind.places(), dtype=float), np.array(kind.weights)
        corners = ELEMENTS[family].nodes
        assert weights.min() >= 0
        np.testing.assert_allclose(weights.sum(axis=1), 1)
        np.testing.assert_allclose(weights @ places[:corners], places, atol=1e-12)
        assert len({tuple(row) for row in places.tolist()}) == len(places)


def test_names_are_those_of_the_table_and_of_gmsh() -> None:
    sizes = {key: len(kind.places()) for key, kind in kinds().items()}
    assert {key: size for key, size in TYPES.values() if key in sizes} == {
        key: size for key, size in sizes.items() if key in {name for name, _ in TYPES.values()}
    }
    assert {key for key, size in TYPES.values() if size > 8} <= sizes.keys()
    for key in sizes.keys() & ELEMENTS.keys():
        assert sizes[key] == ELEMENTS[key].nodes
        assert ELEMENTS[kinds()[key].family].shape is ELEMENTS[key].shape


def test_the_order_of_gmsh_is_told_in_that_of_vtk() -> None:
    for key in ("tetra20", "hexahedron64", "pyramid30", "wedge40", "quad12", "triangle15i"):
        kind = kinds()[key]
        here: NDArray[np.int64] = np.array(kind.places("gmsh"))
        np.testing.assert_array_equal(here[kind.order_of("gmsh")], kind.places())
