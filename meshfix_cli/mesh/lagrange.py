"""Where nodes of elements of any order lie, in the orders of gmsh and of VTK: on a lattice between the corners.

Behind the corners come the nodes on edges, then those in faces, then those inside, which are the nodes of a smaller
element, or, with VTK, in rows where that would be a quadrilateral or a hexahedron. VTK has no pyramids of more than
second order: what is called its order of these is ours. Light to import.

Source: "Gmsh Reference Manual", section "High-order elements", and gmsh, "pointsGenerators.cpp"; VTK,
"vtkHigherOrderTriangle.cxx", "vtkHigherOrderTetra.cxx", "vtkHigherOrderQuadrilateral.cxx" and
"vtkHigherOrderHexahedron.cxx".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from typing import NamedTuple

Place = tuple[int, ...]
Rows = tuple[tuple[int, ...], ...]


class _Family(NamedTuple):
    """The elements of a shape.

    `corners` are those of the lattice of order 1; that of a pyramid has its apex over the first. The corners of the
    element inside lie from each corner a step towards each of its `inwards`, and its order is smaller by `less`.
    """

    corners: Rows
    inwards: Rows
    less: int


_FAMILIES = {
    "line": _Family(((0,), (1,)), ((1,), (0,)), 2),
    "triangle": _Family(((0, 0), (1, 0), (0, 1)), ((1, 2), (2, 0), (0, 1)), 3),
    "quad": _Family(((0, 0), (1, 0), (1, 1), (0, 1)), ((1, 3), (2, 0), (3, 1), (0, 2)), 2),
    "tetra": _Family(
        ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)), 4
    ),
    "pyramid": _Family(
        ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)),
        ((1, 3, 4), (2, 0, 4), (3, 1, 4), (0, 2, 4), (0, 2)), 3,
    ),
    "wedge": _Family(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)), (), 3),
    "hexahedron": _Family(
        ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
        ((1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (5, 7, 0), (6, 4, 1), (7, 5, 2), (4, 6, 3)), 2,
    ),
}  # fmt: skip
_AROUND: Rows = ((0, 1), (1, 2), (2, 0))
# The edges and the faces, in their order and with their corners in theirs.
_GMSH: dict[str, tuple[Rows, Rows]] = {
    "line": ((), ()),
    "triangle": (_AROUND, ()),
    "quad": (((0, 1), (1, 2), (2, 3), (3, 0)), ()),
    "tetra": (((0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)), ((0, 2, 1), (0, 1, 3), (0, 3, 2), (3, 1, 2))),
    "pyramid": (
        ((0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)),
        ((0, 1, 4), (3, 0, 4), (1, 2, 4), (2, 3, 4), (0, 3, 2, 1)),
    ),
    "wedge": (
        ((0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)),
        ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (0, 3, 5, 2), (1, 2, 5, 4)),
    ),
    "hexahedron": (
        ((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)),
        ((0, 3, 2, 1), (0, 1, 5, 4), (0, 4, 7, 3), (1, 2, 6, 5), (2, 3, 7, 6), (4, 5, 6, 7)),
    ),
}  # fmt: skip
_VTK: dict[str, tuple[Rows, Rows]] = {
    "line": ((), ()),
    "triangle": (_AROUND, ()),
    "quad": (((0, 1), (1, 2), (3, 2), (0, 3)), ()),
    "tetra": (((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)), ((0, 1, 3), (2, 3, 1), (0, 3, 2), (0, 2, 1))),
    "wedge": (
        (*_AROUND, (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
        ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    ),
    "pyramid": (((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)), _GMSH["pyramid"][1]),
    "hexahedron": (
        ((0, 1), (1, 2), (3, 2), (0, 3), (4, 5), (5, 6), (7, 6), (4, 7), (0, 4), (1, 5), (2, 6), (3, 7)),
        ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)),
    ),
}  # fmt: skip
_EDGES, _FACES = _VTK["hexahedron"]
# VTK 8 and what was before it had the last two edges of hexahedra the other way round.
_VTK_8 = {**_VTK, "hexahedron": ((*_EDGES[:-2], *_EDGES[:-3:-1]), _FACES)}
ORDERS: Mapping[str, dict[str, tuple[Rows, Rows]]] = {"gmsh": _GMSH, "vtk": _VTK, "vtk 8": _VTK_8}
_IN_ROWS = ("quad", "hexahedron", "triangle of wedge")  # what has rows of nodes inside, by VTK
_AXES = {2: (1,), 3: (1, 2), 4: (1, 3), 8: (1, 3, 4)}  # towards which corners these go, by the number of corners


@cache
def lattice(family: str, order: int, by: str = "gmsh", complete: bool = True) -> tuple[Place, ...]:
    """Return where nodes lie, in steps of which there are `order` along an edge.

    Parameters
    ----------
    family : str
        "line", "triangle", "quad", "tetra", "pyramid", "wedge" or "hexahedron".
    order : int
    by : {"gmsh", "vtk", "vtk 8", "rows"}
        Whose order of nodes; or their coordinates run one after the other, the first fastest.
    complete : bool
        There are nodes also elsewhere than on edges.
    """
    if by == "rows":
        return tuple(sorted(lattice(family, order, complete=complete), key=lambda place: place[::-1]))
    corners = tuple(tuple(order * x for x in corner) for corner in _FAMILIES[family].corners)
    return tuple(_nodes(family, corners, order, by, complete))


class Kind(NamedTuple):
    """A type of elements: its family, its order, and whether it has nodes also elsewhere than on edges.

    Nodes are evenly spaced along edges, or stand closer together at the ends, at the points of Gauss and Lobatto.
    """

    family: str
    order: int
    complete: bool
    lobatto: bool = False

    def places(self, by: str = "vtk") -> tuple[Place, ...]:
        """Where its nodes lie, see `lattice`."""
        return lattice(self.family, self.order, by, self.complete)

    @property
    def weights(self) -> tuple[tuple[float, ...], ...]:
        """(nodes, corners): the values of the shape functions of the linear element at its nodes, in VTK's order."""
        if self.lobatto:
            corners = lattice(self.family, 1, "vtk")
            at = [
                [coordinate for one in _barycentric(self.family, place, 1) for coordinate in one] for place in corners
            ]
            return tuple(
                tuple(math.prod(x for x, one in zip(node, corner, strict=True) if one) for corner in at)
                for node in self.barycentric
            )
        return tuple(tuple(_linear(self.family, place, self.order)) for place in self.places())

    @property
    def factors(self) -> tuple[int, ...]:
        """The dimensions of the simplices whose product it is; there is none for pyramids."""
        return _FACTORS[self.family]

    @property
    def barycentric(self) -> tuple[tuple[float, ...], ...]:
        """(nodes, c): the coordinates of its nodes in all of these, one behind the other, in VTK's order."""
        along = _lobatto(self.order) if self.lobatto else tuple(range(self.order + 1))
        found = []
        for place in self.places():
            parts = [[along[step] for step in steps] for steps in _barycentric(self.family, place, self.order)]
            # Whatever their order, the sum has the same bits: mirrored nodes have the same coordinates.
            found.append(tuple(x / math.fsum(part) for part in parts for x in part))
        return tuple(found)

    def order_of(self, by: str) -> list[int]:
        """Return which of the nodes in another order stands in each place of VTK's."""
        there = {place: i for i, place in enumerate(self.places(by))}
        return [there[place] for place in self.places()]


HIGHEST = 10  # order that has a name


@cache
def kinds() -> dict[str, Kind]:
    """Return the types by their names: that of the family with the number of nodes, and an i to tell two apart."""
    found: dict[str, Kind] = {}
    for family, (corners, _, _) in _FAMILIES.items():
        edges = len(_VTK[family][0])
        some = [Kind(family, order, True) for order in range(2, HIGHEST + 1)]
        found |= {f"{family}{_size(family, kind.order)}": kind for kind in some}
        for order in range(2, HIGHEST + 1):
            name = f"{family}{len(corners) + edges * (order - 1)}"
            kind = Kind(family, order, False)
            if edges and found.setdefault(name, kind).order != order:
                found[f"{name}i"] = kind
    return found


@cache
def lobatto_kinds() -> dict[str, Kind]:
    """Return those of points of Gauss and Lobatto by their names, which end in an l; of second order there are none."""
    return {f"{key}l": kind._replace(lobatto=True) for key, kind in kinds().items() if kind.complete and kind.order > 2}


@cache
def key_of(kind: Kind) -> str:
    """Return the name of a type of second or higher order."""
    return next(key for key, one in (kinds() | lobatto_kinds()).items() if one == kind)


_FACTORS = {"line": (1,), "triangle": (2,), "quad": (1, 1), "tetra": (3,), "wedge": (2, 1), "hexahedron": (1, 1, 1)}


def _barycentric(family: str, place: Place, order: int) -> list[tuple[int, ...]]:
    """Return the coordinates of a place in each of the simplices whose product its family is, in steps."""
    found, at = [], 0
    for n in _FACTORS[family]:
        here = place[at : at + n]
        found.append((order - sum(here), *here))
        at += n
    return found


@cache
def _lobatto(order: int) -> tuple[float, ...]:
    """Return the points of Gauss and Lobatto from 0 to 1: the ends, and where the derivative of Legendre's is zero."""
    if order < 2:
        return (0.0, 1.0)[: order + 1]
    half = []
    for k in range(1, (order + 1) // 2):
        x = math.cos(math.pi * k / order)
        for _ in range(_NEWTON):
            last, legendre = 1.0, x
            for n in range(1, order):
                last, legendre = legendre, ((2 * n + 1) * x * legendre - n * last) / (n + 1)
            first = order * (last - x * legendre) / (1 - x * x)
            x -= first * (1 - x * x) / (2 * x * first - order * (order + 1) * legendre)
        half.append((1 - x) / 2)
    return (0.0, *half, *((0.5,) if order % 2 == 0 else ()), *(1 - x for x in reversed(half)), 1.0)


_NEWTON = 8  # steps, of which each doubles the digits


def _size(family: str, order: int) -> int:
    """Return how many nodes a complete element has."""
    n, triangle = order + 1, (order + 1) * (order + 2) // 2
    return {
        "line": n, "triangle": triangle, "quad": n * n, "tetra": triangle * (order + 3) // 3,
        "pyramid": n * (n + 1) * (2 * n + 1) // 6, "wedge": n * triangle, "hexahedron": n**3,
    }[family]  # fmt: skip


def _linear(family: str, place: Place, order: int) -> Iterator[float]:
    """Give the values of the shape functions of the linear element, each a quotient of integers: 0 is 0."""
    x, y, z = (*place, 0, 0)[:3]
    if family in ("line", "quad", "hexahedron"):
        for corner in _FAMILIES[family].corners:
            yield math.prod(u if one else order - u for u, one in zip(place, corner, strict=True)) / order ** len(place)
    elif family == "wedge":
        yield from (level * one / order**2 for level in (order - z, z) for one in (order - x - y, x, y))
    elif family == "pyramid":
        side = order - z  # of the square at this height
        sides = ((side - x, side - y), (x, side - y), (x, y), (side - x, y))
        yield from (u * v / (max(side, 1) * order) for u, v in sides)
        yield z / order
    else:
        yield from (one / order for one in (order - sum(place), *place))


def _nodes(family: str, corners: Sequence[Place], order: int, by: str, complete: bool = True) -> Iterator[Place]:
    if order < 1:
        yield from corners[: max(order + 1, 0)]
        return
    yield from corners
    edges, faces = ORDERS[by][family]
    for edge in edges:
        yield from _inside("line", [corners[i] for i in edge], order, by)
    if complete:
        for face in faces:
            kind = "quad" if len(face) == 4 else f"triangle of {family}"
            yield from _inside(kind, [corners[i] for i in face], order, by)
        yield from _inside(family, corners, order, by)


def _inside(family: str, corners: Sequence[Place], order: int, by: str) -> Iterator[Place]:
    """Give the nodes that are on none of the sides."""
    if family == "line" or (by != "gmsh" and family in _IN_ROWS):
        axes = [_step(corners[0], corners[i], order) for i in _AXES[len(corners)]]
        for steps in product(range(1, order), repeat=len(axes)):
            if len(corners) != 3 or sum(steps) < order:
                yield _plus(corners[0], *(_times(n, axis) for n, axis in zip(steps[::-1], axes, strict=True)))
        return
    if family == "wedge":
        yield from _inside_wedge(corners, order, by)
        return
    family = family.split()[0]
    inner = [
        _plus(corner, *(_step(corner, corners[i], order) for i in towards))
        for corner, towards in zip(corners, _FAMILIES[family].inwards, strict=True)
    ]
    yield from _nodes(family, inner, order - _FAMILIES[family].less, by)


def _inside_wedge(corners: Sequence[Place], order: int, by: str) -> Iterator[Place]:
    """Give the nodes of a triangle on each level: gmsh all those over one another, VTK all of one level."""
    up, levels = _step(corners[0], corners[3], order), [one[0] + 1 for one in lattice("line", order - 2)]
    base = list(_inside("triangle of wedge", corners[:3], order, by))
    if by == "gmsh":
        yield from (_plus(place, _times(level, up)) for place in base for level in levels)
    else:
        yield from (_plus(place, _times(level, up)) for level in sorted(levels) for place in base)


def _step(first: Place, last: Place, order: int) -> Place:
    return tuple((b - a) // order for a, b in zip(first, last, strict=True))


def _times(count: int, step: Place) -> Place:
    return tuple(count * x for x in step)


def _plus(*places: Place) -> Place:
    return tuple(map(sum, zip(*places, strict=True)))
