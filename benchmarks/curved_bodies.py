"""Coarse meshes of second order around what is round, made by gmsh: many have invalid elements."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import cos, pi, sin
from typing import Any

Body = Callable[[Any], float]


def holes(count: int, radius: float) -> Body:
    """Return a square plate with small round holes."""

    def build(gmsh: Any) -> float:
        occ = gmsh.model.occ
        plate = occ.addRectangle(0, 0, 0, 1, 1)
        places = [(0.5 + 0.3 * cos(2 * pi * k / count), 0.5 + 0.3 * sin(2 * pi * k / count)) for k in range(count)]
        occ.cut([(2, plate)], [(2, occ.addDisk(x, y, 0, radius, radius)) for x, y in places])
        return 0.2

    return build


def ring(inner: float, size: float) -> Body:
    """Return a disk with a hole."""

    def build(gmsh: Any) -> float:
        occ = gmsh.model.occ
        occ.cut([(2, occ.addDisk(0, 0, 0, 1, 1))], [(2, occ.addDisk(0, 0, 0, inner, inner))])
        return size

    return build


def wing(thickness: float) -> Body:
    """Return a box with a thin ellipse in it."""

    def build(gmsh: Any) -> float:
        occ = gmsh.model.occ
        occ.cut([(2, occ.addRectangle(-1, -1, 0, 3, 2))], [(2, occ.addDisk(0.3, 0, 0, 0.5, thickness))])
        return 0.5

    return build


def pipe(wall: float, size: float) -> Body:
    """Return a pipe with a thin wall."""

    def build(gmsh: Any) -> float:
        occ = gmsh.model.occ
        outer, inner = (occ.addCylinder(0, 0, 0, 0, 0, 2, r) for r in (0.5, 0.5 - wall))
        occ.cut([(3, outer)], [(3, inner)])
        return size

    return build


def ball(size: float) -> Body:
    """Return a ball."""

    def build(gmsh: Any) -> float:
        gmsh.model.occ.addSphere(0, 0, 0, 1)
        return size

    return build


def bubbles(count: int, radius: float, size: float) -> Body:
    """Return a cube with small round holes."""

    def build(gmsh: Any) -> float:
        occ = gmsh.model.occ
        cube = occ.addBox(0, 0, 0, 1, 1, 1)
        places = [(0.25 + 0.5 * (k % 2), 0.25 + 0.5 * (k // 2 % 2), 0.25 + 0.5 * (k // 4)) for k in range(count)]
        occ.cut([(3, cube)], [(3, occ.addSphere(*place, radius)) for place in places])
        return size

    return build


def torus(tube: float, size: float) -> Body:
    """Return a torus."""

    def build(gmsh: Any) -> float:
        gmsh.model.occ.addTorus(0, 0, 0, 1, tube)
        return size

    return build


def drilled(radius: float, size: float) -> Body:
    """Return a cube with a hole drilled through it."""

    def build(gmsh: Any) -> float:
        occ = gmsh.model.occ
        occ.cut([(3, occ.addBox(0, 0, 0, 1, 1, 1))], [(3, occ.addCylinder(0.5, 0.5, 0, 0, 0, 1, radius))])
        return size

    return build


BODIES: dict[str, Body] = {
    **{f"plate, {n} holes of {r}": holes(n, r) for n, r in ((1, 0.02), (3, 0.05), (5, 0.1), (8, 0.1))},
    **{f"ring {inner}": ring(inner, size) for inner, size in ((0.1, 0.8), (0.5, 0.8), (0.9, 0.8), (0.95, 0.5))},
    **{f"wing {thickness}": wing(thickness) for thickness in (0.02, 0.05, 0.15)},
    **{f"pipe {wall}": pipe(wall, size) for wall, size in ((0.05, 0.4), (0.1, 0.5), (0.2, 0.6))},
    **{f"ball {size}": ball(size) for size in (0.7, 1.2)},
    **{f"cube, {n} bubbles of {r}": bubbles(n, r, h) for n, r, h in ((1, 0.1, 0.5), (4, 0.1, 0.4), (8, 0.2, 0.5))},
    **{f"torus {tube}": torus(tube, size) for tube, size in ((0.2, 0.3), (0.4, 0.8))},
    **{f"drilled {radius}": drilled(radius, size) for radius, size in ((0.05, 0.15), (0.2, 0.6))},
}


def made(gmsh: Any, names: tuple[str, ...] = tuple(BODIES)) -> Iterator[str]:
    """Make the meshes one after the other, each the model of a session of gmsh; give their names."""
    for name in names:
        gmsh.clear()
        gmsh.model.add(name)
        size = BODIES[name](gmsh)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(gmsh.model.getDimension())
        gmsh.model.mesh.setOrder(2)
        yield name
