"""The one table of element types: what they are called, what their facets are, and which of them are solved for.

A type that is known and not judged is held where it stands beside elements that are; one of higher order is judged as
the linear one of its corners where its other nodes lie between these. Corner nodes have the order of gmsh, which is
that of VTK's parametric coordinates, and other nodes that of VTK. Light to import.

Source: VTK, "vtkCellType.h" and its classes of cells; "Gmsh Reference Manual", section "Node ordering"; for the weights
Stimpson, Ernst, Knupp, Pebay, Thompson, "The Verdict Geometric Quality Library", SAND2007-1751.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache, cached_property

from meshfix_cli.mesh.lagrange import Kind, kinds, lobatto_kinds

Rows = tuple[tuple[int, ...], ...]
Weights = tuple[tuple[float, ...], ...]
MEASURES = {1: "length", 2: "area", 3: "volume"}


@dataclass(frozen=True, eq=False)
class Shape:
    """What the types of one shape have in common, whatever their order.

    Attributes
    ----------
    name, plural : str
    dimension : int
    corners : int
        Number of corner nodes; 0: any.
    facets : tuple of tuples of int
        Corner nodes of each facet, in positive order seen from outside. That of a simplex which is opposite its node i
        has the number i; those of others are in VTK's order.
    simplices : tuple of tuples of int
        The corner simplices: each a node and its neighbours in the element, in the order that makes all determinants
        positive in a valid element.
    parallel : tuple of tuples of (int, int)
        The edges, those together that are parallel in the ideal element.
    ideal : tuple of tuples of float
        The edges of a corner simplex from its first node, in the ideal element.
    mirrored : tuple of int
        An order of the nodes that has the other orientation: the first two change places, and what lies over or beside
        them as they do. So those that programs repeat in an element of fewer corners, as the last two of a
        quadrilateral, stay where they are looked for; VTK's pixels and voxels turn by the same order.
    """

    name: str
    plural: str
    dimension: int
    corners: int
    facets: Rows = ()
    simplices: Rows = ()
    ideal: tuple[tuple[float, ...], ...] = ()
    parallel: tuple[tuple[tuple[int, int], ...], ...] = ()
    mirrored: tuple[int, ...] = ()

    @property
    def weight(self) -> float:
        """Turns the determinant of the unit edges at an ideal corner into 1: scaled Jacobians."""
        edges = self.ideal
        if len(edges) < 3:
            return 1.0 if len(edges) < 2 else 1 / (edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0])
        (a, b, c), (d, e, f), (g, h, i) = edges
        return 1 / (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))

    @property
    def facet(self) -> str:
        """What a facet is called where elements share it."""
        return {1: "vertex", 2: "edge", 3: "triangle" if self.name == "tetrahedron" else "face"}[self.dimension]

    @property
    def measure(self) -> str:
        """What its size is called."""
        return MEASURES[self.dimension]

    @property
    def angle(self) -> str:
        """What the angles between its facets are called."""
        return "dihedral angle" if self.dimension == 3 else "angle"


@dataclass(frozen=True, eq=False)
class Element:
    """A type of element.

    Attributes
    ----------
    key : str
        By which a file's cells are named: meshio's name, or ours where it has none.
    shape : Shape
    nodes : int
        0: any.
    vtk, gmsh : int or None
        The numbers by which these know it.
    judged_by : {"determinant", "corners", "coefficients"} or None
        What decides whether it is valid: the one determinant, those of the corner simplices, or the Bezier coefficients
        of the Jacobian determinant; None: it is held, and not judged, but for what `straight` tells.
    between : str
        For each node that is no corner a word: the corners in whose middle it lies where the element is straight. One
        that counts twice stands there twice.
    lattice : Kind or None
        Where its nodes lie, instead, if it is of more than second order.
    """

    key: str
    shape: Shape
    nodes: int
    vtk: int | None = None
    gmsh: int | None = None
    judged_by: str | None = None
    between: str = ""
    lattice: Kind | None = None

    @property
    def linear(self) -> bool:
        """Whether its nodes are its corners."""
        return self.nodes == self.shape.corners

    @property
    def straight(self) -> Element | None:
        """The judged type of its corners, of which it is a refinement where its other nodes lie between them."""
        if self.judged_by:
            return self
        higher = self.between or self.lattice
        return next((one for one in JUDGED if one.shape is self.shape), None) if higher else None

    @cached_property
    def weights(self) -> Weights:
        """(nodes - corners, corners): where its other nodes lie if it is straight, as weights of its corners.

        They are the values that the shape functions of the linear element have there.
        """
        if self.lattice is not None:
            return self.lattice.weights[self.shape.corners :]
        words, corners = self.between.split(), range(self.shape.corners)
        return tuple(tuple(word.count(str(corner)) / len(word) for corner in corners) for word in words)

    @cached_property
    def mirrored(self) -> tuple[int, ...]:
        """An order of all nodes that has the other orientation: corners as `Shape.mirrored`, and what is between."""
        corners = self.shape.mirrored
        there = {weights: place for place, weights in enumerate(self.weights, self.shape.corners)}
        others = (tuple(weights[corners.index(corner)] for corner in range(len(corners))) for weights in self.weights)
        return (*corners, *(there[weights] for weights in others))


_VERTEX = Shape("vertex", "vertices", 0, 1)
_LINE = Shape("line", "lines", 1, 2, ((1,), (0,)), ((0, 1),))
_TRIANGLE = Shape(
    "triangle", "triangles", 2, 3, ((1, 2), (2, 0), (0, 1)), ((0, 1, 2),), ((1, 0), (0.5, math.sqrt(0.75))),
    (((0, 1),), ((1, 2),), ((2, 0),)),
    mirrored=(1, 0, 2),
)  # fmt: skip
_QUAD = Shape(
    "quadrilateral", "quadrilaterals", 2, 4, ((0, 1), (1, 2), (2, 3), (3, 0)),
    ((0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)), ((1, 0), (0, 1)),
    (((0, 1), (3, 2)), ((0, 3), (1, 2))),
    mirrored=(1, 0, 3, 2),
)  # fmt: skip
_TETRA = Shape(
    "tetrahedron", "tetrahedra", 3, 4, ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)), ((0, 1, 2, 3),),
    ((1, 0, 0), (0.5, math.sqrt(0.75), 0), (0.5, math.sqrt(1 / 12), math.sqrt(2 / 3))),
    (((0, 1),), ((0, 2),), ((0, 3),), ((1, 2),), ((1, 3),), ((2, 3),)),
    mirrored=(1, 0, 2, 3),
)  # fmt: skip
_PYRAMID = Shape(
    "pyramid", "pyramids", 3, 5, ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    ((0, 1, 3, 4), (1, 2, 0, 4), (2, 3, 1, 4), (3, 0, 2, 4)),
    ((1, 0, 0), (0, 1, 0), (0.5, 0.5, math.sqrt(0.5))),
    (((0, 1), (3, 2)), ((0, 3), (1, 2)), ((0, 4),), ((1, 4),), ((2, 4),), ((3, 4),)),
    mirrored=(1, 0, 3, 2, 4),
)  # fmt: skip
_WEDGE = Shape(
    "wedge", "wedges", 3, 6, ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2)),
    ((1, 0, 0), (0.5, math.sqrt(0.75), 0), (0, 0, 1)),
    (((0, 1), (3, 4)), ((1, 2), (4, 5)), ((2, 0), (5, 3)), ((0, 3), (1, 4), (2, 5))),
    mirrored=(1, 0, 2, 4, 3, 5),
)  # fmt: skip
_HEXAHEDRON = Shape(
    "hexahedron", "hexahedra", 3, 8,
    ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
    (
        (0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7),
        (4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3),
    ),
    ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    (((0, 1), (3, 2), (4, 5), (7, 6)), ((0, 3), (1, 2), (4, 7), (5, 6)), ((0, 4), (1, 5), (2, 6), (3, 7))),
    mirrored=(1, 0, 3, 2, 5, 4, 7, 6),
)  # fmt: skip


COLLAPSED = "collapsed_"  # begins the keys of these


def _collapsed(shape: Shape) -> Shape:
    """Of elements that name a node several times, and so have fewer corners, and are of no other type."""
    return Shape(f"collapsed {shape.name}", f"collapsed {shape.plural}", shape.dimension, 0)


_PIXEL = Shape("pixel", "pixels", 2, 0)  # VTK's own order of a rectangle's and a box's corners
_VOXEL = Shape("voxel", "voxels", 3, 0)
_STRIP = Shape("strip of triangles", "strips of triangles", 2, 0)
_POLYGON = Shape("polygon", "polygons", 2, 0)
_POLYHEDRON = Shape("polyhedron", "polyhedra", 3, 0)
# Between which corners the nodes of second order lie: on edges, in faces.
_ON_TRIANGLE, _ON_QUAD, _ON_TETRA = "01 12 20", "01 12 23 30", "01 12 20 03 13 23"
_ON_PYRAMID, _ON_WEDGE = "01 12 23 30 04 14 24 34", "01 12 20 34 45 53 03 14 25"
_ON_HEXAHEDRON = "01 12 23 30 45 56 67 74 04 15 26 37"
_IN_PYRAMID = "0001112223334444"  # a quarter of the way from the base to the apex
_IN_HEXAHEDRON = "0473 1265 0154 3762 0321 4567 01234567"
_SHAPES = (_TRIANGLE, _QUAD, _TETRA, _PYRAMID, _WEDGE, _HEXAHEDRON)
_TABLE = (
    Element("vertex", _VERTEX, 1, vtk=1, gmsh=15),
    Element("line", _LINE, 2, vtk=3, gmsh=1),
    Element("line3", _LINE, 3, vtk=21, gmsh=8, between="01"),
    Element("line4", _LINE, 4, vtk=35, gmsh=26, between="001 011"),
    Element("triangle", _TRIANGLE, 3, vtk=5, gmsh=2, judged_by="determinant"),
    Element("triangle6", _TRIANGLE, 6, vtk=22, gmsh=9, between=_ON_TRIANGLE),
    Element("triangle7", _TRIANGLE, 7, vtk=34, between=f"{_ON_TRIANGLE} 012"),
    Element("quad", _QUAD, 4, vtk=9, gmsh=3, judged_by="corners"),
    Element("quad6", _QUAD, 6, vtk=30, between="01 23"),
    Element("quad8", _QUAD, 8, vtk=23, gmsh=16, between=_ON_QUAD),
    Element("quad9", _QUAD, 9, vtk=28, gmsh=10, between=f"{_ON_QUAD} 0123"),
    Element("tetra", _TETRA, 4, vtk=10, gmsh=4, judged_by="determinant"),
    Element("tetra10", _TETRA, 10, vtk=24, gmsh=11, between=_ON_TETRA),
    Element("pyramid", _PYRAMID, 5, vtk=14, gmsh=7, judged_by="corners"),
    Element("pyramid13", _PYRAMID, 13, vtk=27, gmsh=19, between=_ON_PYRAMID),
    Element("pyramid14", _PYRAMID, 14, gmsh=14, between=f"{_ON_PYRAMID} 0123"),
    Element("pyramid19", _PYRAMID, 19, vtk=37, between=f"{_ON_PYRAMID} 0123 014 124 234 304 {_IN_PYRAMID}"),
    Element("wedge", _WEDGE, 6, vtk=13, gmsh=6, judged_by="coefficients"),
    Element("wedge12", _WEDGE, 12, vtk=31, between="01 12 20 34 45 53"),
    Element("wedge15", _WEDGE, 15, vtk=26, gmsh=18, between=_ON_WEDGE),
    Element("wedge18", _WEDGE, 18, vtk=32, gmsh=13, between=f"{_ON_WEDGE} 0143 1254 2035"),
    Element("hexahedron", _HEXAHEDRON, 8, vtk=12, gmsh=5, judged_by="coefficients"),
    Element("hexahedron20", _HEXAHEDRON, 20, vtk=25, gmsh=17, between=_ON_HEXAHEDRON),
    Element("hexahedron24", _HEXAHEDRON, 24, vtk=33, between=f"{_ON_HEXAHEDRON} 0473 1265 0154 3762"),
    Element("hexahedron27", _HEXAHEDRON, 27, vtk=29, gmsh=12, between=f"{_ON_HEXAHEDRON} {_IN_HEXAHEDRON}"),
    Element("triangle_strip", _STRIP, 0, vtk=6),
    Element("polygon", _POLYGON, 0, vtk=7),
    Element("pixel", _PIXEL, 4, vtk=8),
    Element("voxel", _VOXEL, 8, vtk=11),
    Element("polyhedron", _POLYHEDRON, 0, vtk=42),
    *(Element(f"{COLLAPSED}{one.name}", _collapsed(one), 0) for one in _SHAPES),
)
ELEMENTS = {element.key: element for element in _TABLE}

# What is solved for, by its dimension.
SIMPLICES = {element.shape.dimension: element for element in _TABLE if element.judged_by == "determinant"}

# All that is judged, in the order of the kernels' numbers for them.
JUDGED = tuple(ELEMENTS[key] for key in ("triangle", "quad", "tetra", "pyramid", "wedge", "hexahedron"))

# What stands for elements of several types, by their dimension.
MIXED = {d: Element("mixed", Shape("element", "elements", d, 0), 0) for d in (2, 3)}

# Types that are not in the table have a shape by their names: tetra35, VTK_LAGRANGE_WEDGE, penta_prism, ...
_FAMILIES = {
    3: ("tetra", "hexa", "wedge", "pyramid", "penta", "voxel", "polyhedron"),
    2: ("triangle", "quad", "polygon", "pixel"),
    1: ("line", "poly_line", "curve"),
}


def element_of(key: str) -> Element | None:
    """Return the type that a file's cells are named by; None: no more is known of it than its name tells."""
    return ELEMENTS.get(key) or _of_any_order(key)


@cache
def _of_any_order(key: str) -> Element | None:
    kind = kinds().get(key) or lobatto_kinds().get(key)
    return None if kind is None else Element(key, ELEMENTS[kind.family].shape, len(kind.places()), lattice=kind)


def straight_key(key: str) -> str | None:
    """Return the judged type of the corners of a type, see `Element.straight`."""
    element = element_of(key)
    straight = None if element is None else element.straight
    return None if straight is None else straight.key


def dimension_of(key: str) -> int:
    """Return the dimension of a type, by its name where it is not in the table; 0 where that tells nothing."""
    element = element_of(key)
    if element is not None:
        return element.shape.dimension
    name = re.sub("^vtk_[a-z]+_", "", key.lower())
    return next((dimension for dimension, names in _FAMILIES.items() if name.startswith(names)), 0)


def words(key: str) -> tuple[str, str]:
    """Return what one element, and what several, of a type are called."""
    element = element_of(key)
    if element is None:
        return f"{key} element", f"{key} elements"
    lobatto = element.lattice is not None and element.lattice.lobatto
    nodes = f"{element.nodes} {'Gauss-Lobatto ' * lobatto}nodes"
    order = "" if element.linear or not element.shape.corners else f" of {nodes}"
    return f"{element.shape.name}{order}", f"{element.shape.plural}{order}"


def role(dimension: int, of: int) -> tuple[str, str]:
    """Return what one cell, and what several, of a dimension are called in a mesh of a dimension."""
    lower = {0: ("vertex", "vertices"), 1: ("edge", "edges"), 2: ("face", "faces")}
    return lower[dimension] if dimension < of else ("element", "elements")


def counted(number: int, singular: str, plural: str) -> str:
    """Return a number with the word for what it counts."""
    return f"{number:,} {singular if number == 1 else plural}"
