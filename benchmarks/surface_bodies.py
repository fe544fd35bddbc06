"""Triangles on surfaces that are known exactly; each body is a function of its arguments, made by the project alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from exact_surfaces import Bumps, Ellipsoid, Lid, Mask, Piece, Points, Surface, Torus, Wall, circle, unit
from geometries import polygon, positive
from numpy.typing import NDArray
from scipy.spatial import Delaunay

Cells = NDArray[np.int64]

HELD = -1  # the surface of points that lie on a boundary or on a sharp edge
MARGIN = 0.2  # mean edge lengths that moved points stay away from what is held
TRIES = 30
CHORD = 0.06  # mean edge lengths that triangles of a mesh are off the curved surface
TURN = 15.0  # degrees, between normals of triangles of a mesh and of the surface
UNDIVIDED = 1.01  # times h, the length to which `polygon` leaves edges of about h as they are


@dataclass(frozen=True, eq=False)
class Body:
    """A triangulated surface, and the smooth surfaces that it lies on.

    Attributes
    ----------
    points : (n, 3) float64
        In model units.
    cells : (m, 3) int64
        Triangles, anticlockwise seen from where the normals of the surfaces point.
    surfaces : sequence of Surface
    of_points : (n,) int64
        Which surface each point lies on; `HELD` for those on boundaries and sharp edges.
    of_cells : (m,) int64
        Which surface each triangle lies on.
    """

    points: Points
    cells: Cells
    surfaces: Sequence[Surface]
    of_points: Cells
    of_cells: Cells

    @property
    def h(self) -> float:
        """The mean length of the distinct edges, in model units."""
        low, high = np.sort(np.concatenate([self.cells[:, [k, k - 1]] for k in range(3)]), axis=1).T
        start, end = np.divmod(np.unique(low * len(self.points) + high), len(self.points))
        return float(np.linalg.norm(self.points[start] - self.points[end], axis=1).mean())

    @property
    def free(self) -> Cells:
        """Rows (k,) of the points that lie inside a surface."""
        return np.flatnonzero(self.of_points != HELD)

    @property
    def rims(self) -> Cells:
        """The edges (k, 2) on the boundary, or where two surfaces meet."""
        edges = np.sort(np.concatenate([self.cells[:, [k, k - 1]] for k in range(3)]), axis=1)
        ends, number = np.unique(edges, axis=0, return_inverse=True)
        on_each = np.unique(np.column_stack([number.ravel(), np.tile(self.of_cells, 3)]), axis=0)[:, 0]
        alone = np.bincount(number.ravel()) == 1
        return ends[alone | (np.bincount(on_each) > 1)]

    def at(self, points: Points) -> Body:
        """Return the same body with other points (n, 3)."""
        return replace(self, points=points)

    def normals(self, rows: Cells) -> Points:
        """Return the exact normals (k, 3) at some points that are not held."""
        return self._each(self.of_points[rows], self.points[rows], lambda surface, points: surface.normal(points))

    def project(self, rows: Cells, points: Points) -> Points:
        """Return the places (k, 3) on their surfaces of points (k, 3) that stand for some that are not held."""
        return self._each(self.of_points[rows], points, lambda surface, points: surface.project(points))

    def inside(self, rows: Cells, points: Points, margin: float) -> Mask:
        """Mark which points (k, 3), that stand for some that are not held, are inside the surfaces of these."""
        marks = np.zeros(len(rows), dtype=bool)
        for which, surface in enumerate(self.surfaces):
            here = self.of_points[rows] == which
            marks[here] = surface.inside(points[here], margin)
        return marks

    def normals_of_cells(self, points: Points) -> Points:
        """Return the exact normals (m, 3) at the middles of the triangles, with points (n, 3) in place of its own."""
        middles = points[self.cells].mean(axis=1)
        return self._each(self.of_cells, middles, lambda surface, points: surface.normal(surface.project(points)))

    def off(self, points: Points) -> Points:
        """Return how far (m,) the middles of triangles and of their edges are at most off the exact surfaces.

        With points (n, 3) in place of its own; in model units.
        """
        corners = points[self.cells]
        middles = [corners.mean(axis=1), *((corners[:, k] + corners[:, k - 1]) / 2 for k in range(3))]
        exact = (self._each(self.of_cells, one, lambda surface, points: surface.project(points)) for one in middles)
        return np.max([np.linalg.norm(a - b, axis=1) for a, b in zip(middles, exact, strict=True)], axis=0)

    def _each(self, which: Cells, points: Points, action: Callable[[Surface, Points], Points]) -> Points:
        values = np.empty((len(points), 3))
        for number, surface in enumerate(self.surfaces):
            here = which == number
            values[here] = action(surface, points[here])
        return values


def areas(points: Points, cells: Cells) -> Points:
    """Return the area vectors (m, 3) of triangles."""
    a, b, c = points[cells].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


def smallest_angles(points: Points, cells: Cells) -> Points:
    """Return the smallest angle (m,) of each triangle, in degrees; 0 where two corners coincide."""
    corners = points[cells]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    across = np.linalg.norm(np.cross(ahead, back), axis=2)
    return np.degrees(np.arctan2(across, (ahead * back).sum(axis=2)).min(axis=1))


def tangled(body: Body, percent: float, distance: float, seed: int = 0) -> Body:
    """Move a percentage of all points along their surfaces, in random directions; those that are held stay.

    A direction is drawn anew where it leads out of the surface; where all do, the point stays.

    Parameters
    ----------
    body : Body
    percent : float
    distance : float
        In the tangent plane, in mean edge lengths.
    seed : int
    """
    random, points, h = np.random.default_rng(seed), body.points.copy(), body.h
    count = min(len(body.free), round(len(points) * percent / 100))
    left = np.sort(random.choice(body.free, count, replace=False))
    for _ in range(TRIES):
        target = body.project(left, points[left] + distance * h * tangents(body, left, random))
        good = body.inside(left, target, MARGIN * h)
        points[left[good]] = target[good]
        left = left[~good]
    return body.at(points)


def tangents(body: Body, rows: Cells, random: np.random.Generator) -> Points:
    """Return random unit vectors (k, 3) in the tangent planes at some points that are not held."""
    normals, drawn = body.normals(rows), random.normal(size=(len(rows), 3))
    return unit(drawn - (drawn * normals).sum(axis=1, keepdims=True) * normals)


def worsened(body: Body, distance: float, smallest: float, seed: int = 0) -> Body:
    """Move all points along their surfaces, so far that no triangle has an angle below a smallest one.

    Nor do triangles get `CHORD` off the exact surface, or turned from it by `TURN`: edges inside it stay no sharp ones.

    Parameters
    ----------
    body : Body
        All angles of which are larger.
    distance : float
        The largest, in mean edge lengths; those of a triangle that gets worse are halved.
    smallest : float
        In degrees.
    seed : int
    """
    random, points, rows, margin = np.random.default_rng(seed), body.points.copy(), body.free, MARGIN * body.h
    steps = distance * body.h * tangents(body, rows, random) * np.sqrt(random.uniform(size=(len(rows), 1)))
    for _ in range(100):
        points[rows] = body.project(rows, body.points[rows] + steps)
        bad = smallest_angles(points, body.cells) < smallest
        cosines = (unit(areas(points, body.cells)) * body.normals_of_cells(points)).sum(axis=1)
        bad |= cosines < np.cos(np.radians(TURN))
        bad |= body.off(points) > CHORD * body.h
        wrong = ~body.inside(rows, points[rows], margin) | np.isin(rows, body.cells[bad])
        wrong &= steps.any(axis=1)
        if not wrong.any():
            break
        steps[wrong] /= 2
        steps[np.linalg.norm(steps, axis=1) < 1e-3 * body.h] = 0
    return body.at(points)


def ellipsoid(level: int, axes: tuple[float, float, float] = (2.0, 1.0, 0.5)) -> Body:
    """Return a stretched icosahedron, each edge of which was halved some times."""
    points, cells = icosphere(level)
    return _smooth(points * axes, cells, Ellipsoid(axes))


def icosphere(level: int) -> tuple[Points, Cells]:
    """Return points (n, 3) of the unit sphere and 20 x 4**level triangles."""
    g = (1 + 5**0.5) / 2
    corners = [(-1.0, g, 0.0), (1.0, g, 0.0), (-1.0, -g, 0.0), (1.0, -g, 0.0)]
    points = unit(np.array([np.roll(corner, shift) for shift in range(3) for corner in corners]))
    cells = Delaunay(points).convex_hull.astype(np.int64)
    outwards = (areas(points, cells) * points[cells[:, 0]]).sum(axis=1) > 0
    cells = np.where(outwards[:, None], cells, cells[:, ::-1])
    for _ in range(level):
        edges = np.sort(cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        ends, number = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = (number.reshape(-1, 3) + len(points)).T
        a, b, c = cells.T
        points = np.concatenate([points, unit(points[ends].mean(axis=1))])
        thirds = (a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)
        cells = np.concatenate([np.column_stack(corners) for corners in thirds])
    return points, cells


def torus(around: int, across: int, tube: float = 0.4) -> Body:
    """Return a grid on a torus, whose quadrilaterals are halved."""
    u, v = (x.ravel() for x in np.mgrid[0:around, 0:across])
    angle, turn = 2 * pi * v / across, 2 * pi * u / around
    reach = 1 + tube * np.cos(angle)
    points = np.column_stack([reach * np.cos(turn), reach * np.sin(turn), tube * np.sin(angle)])
    corners = [((u + i) % around) * across + (v + j) % across for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return _smooth(points, halved(np.column_stack(corners)), Torus(tube))


def bumps(count: int, height: float = 0.0833, waves: tuple[float, float] = (3.2, 2.6)) -> Body:
    """Return a grid of some vertices a side on a graph over the unit square."""
    surface = Bumps(height, waves)
    u, v = (x.ravel() for x in np.mgrid[0:count, 0:count])
    points = surface.over(np.column_stack([u, v]) / (count - 1))
    inner = (u < count - 1) & (v < count - 1)
    u, v = u[inner], v[inner]
    corners = [(u + i) * count + v + j for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    body = _smooth(points, halved(np.column_stack(corners)), surface)
    inside = surface.inside(points, 1e-9)
    return replace(body, of_points=np.where(inside, 0, HELD))


def halved(quads: Cells) -> Cells:
    """Return the triangles (2m, 3) of quadrilaterals (m, 4), halved along the diagonal from the first corner."""
    return np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])


def jittered(count: int, height: float, share: float = 0.2, seed: int = 0) -> Body:
    """Return `bumps` whose inner vertices are moved by a share of the step of the grid at most, along each axis.

    Its quadrilaterals are halved along either diagonal, at random; up to a quarter of the step no triangle is folded.
    """
    body, random = bumps(count, height), np.random.default_rng(seed)
    points, rows = body.points.copy(), body.free
    points[rows, :2] += share / (count - 1) * random.uniform(-1, 1, (len(rows), 2))
    points[rows] = body.project(rows, points[rows])
    first, second = np.split(body.cells, 2)
    a, b, c, d = first[:, 0], first[:, 1], first[:, 2], second[:, 2]
    turned = random.random(len(a)) < 0.5
    quads = np.where(turned[:, None], np.column_stack([b, c, d, a]), np.column_stack([a, b, c, d]))
    return replace(body, points=points, cells=halved(quads))


def _smooth(points: Points, cells: Cells, surface: Surface) -> Body:
    return Body(points, cells, (surface,), np.zeros(len(points), np.int64), np.zeros(len(cells), np.int64))


def cylinder(h: float, radius: float = 1.0, height: float = 2.0) -> Body:
    """Return a cylinder with lids, of edges near h in model units."""
    return extruded([[circle(0.0, 0.0, radius)]], height, h)


def part(h: float, height: float = 0.8) -> Body:
    """Return a lug: a plate with one round end and two holes drilled through it, of edges near h in model units."""
    end = (Piece((0.0, 0.0), (3.0, 0.0)), Piece((3.0, 0.0), (3.0, 2.0), (3.0, 1.0), pi), Piece((3.0, 2.0), (0.0, 2.0)))
    holes = [[circle(x, 1.0, radius, -2 * pi)] for x, radius in ((3.0, 0.6), (1.0, 0.5))]
    return extruded([[end, (Piece((0.0, 2.0), (0.0, 0.0)),)], *holes], height, h)


def extruded(loops: Sequence[Sequence[Sequence[Piece]]], height: float, h: float) -> Body:
    """Return the surface of what a region of the plane sweeps from z = 0 to a height.

    Each loop of the boundary consists of smooth chains, which meet in corners; it has the region at its left.
    """
    body = _Sweep(height, h)
    for loop in loops:
        body.add(loop)
    return body.closed()


class _Sweep:
    """Gathers the points and triangles of a body that is swept."""

    def __init__(self, height: float, h: float) -> None:
        self.h, self.height = h, height
        self.layers = round(height / h)
        self.points: list[Points] = []
        self.cells: list[Cells] = []
        self.of_points: list[int] = []
        self.walls: list[Wall] = []
        self.of_cells: list[int] = []
        self.rims: list[tuple[Cells, Cells]] = []  # rows of the points below and above, of each loop

    def _new(self, points: Points, surface: int) -> Cells:
        self.points += list(points)
        self.of_points += [surface] * len(points)
        return np.arange(len(self.points) - len(points), len(self.points))

    def _more(self, cells: Cells, surface: int) -> None:
        self.cells += list(cells)
        self.of_cells += [surface] * len(cells)

    def add(self, loop: Sequence[Sequence[Piece]]) -> None:
        """Add the walls of a loop."""
        walls = [Wall(chain, self.height) for chain in loop]
        steps = [np.arange(count) / count * wall.length for wall in walls for count in [round(wall.length / self.h)]]
        low, high = (
            [self._new(wall.swept(_at(s, z)), HELD) for wall, s in zip(walls, steps, strict=True)]
            for z in (0.0, self.height)
        )
        self.rims.append((np.concatenate(low), np.concatenate(high)))
        if walls[0].closed:
            self._around(walls[0], steps[0], low[0], high[0])
            return
        posts = [self._new(wall.swept(self._post(0.0)), HELD) for wall in walls]
        for k, wall in enumerate(walls):
            after = (k + 1) % len(walls)
            corners = low[after][:1], high[after][:1]
            ring = [low[k], corners[0], posts[after], corners[1], high[k][::-1], posts[k][::-1]]
            self._between(wall, np.append(steps[k], wall.length), np.concatenate(ring))

    def _post(self, s: float) -> Points:
        """Return the points (k, 2) of a wall on a sharp edge, without its ends."""
        z = np.arange(1, self.layers) / self.layers * self.height
        return np.column_stack([np.full(len(z), s), z])

    def _between(self, wall: Wall, s: Points, ring: Cells) -> None:
        """Add a wall between two sharp edges, the points around which are there."""
        number = len(self.walls)
        self.walls.append(wall)
        sides = self._post(wall.length), self._post(0.0)[::-1]
        flat = np.concatenate([_at(s, 0.0), sides[0], _at(s, self.height)[::-1], sides[1]])
        found, cells = polygon(UNDIVIDED * self.h, flat, seed=number)
        self._more(np.concatenate([ring, self._new(wall.swept(found[len(flat) :]), number)])[cells], number)

    def _around(self, wall: Wall, s: Points, low: Cells, high: Cells) -> None:
        """Add a wall that closes: the triangles of three turns whose middles lie in the second."""
        number = len(self.walls)
        self.walls.append(wall)
        rows = round(self.height / (0.866 * self.h))
        turn, step = np.array([wall.length, 0.0]), np.array([wall.length / len(s), self.height / rows])
        i, j = (x.ravel() for x in np.mgrid[0 : len(s), 1:rows])
        places = np.column_stack([i + 0.25 + j % 2 / 2, j])
        inner = (places + np.random.default_rng(number).uniform(-0.2, 0.2, places.shape)) * step
        flat = np.concatenate([_at(s, 0.0), _at(s, self.height), inner])
        ring = np.concatenate([low, high, self._new(wall.swept(inner), number)])
        turns = np.concatenate([flat - turn, flat, flat + turn])
        cells = positive(turns, Delaunay(turns).simplices)
        middles = turns[cells].mean(axis=1)[:, 0]
        flat_ones = np.linalg.det(turns[cells[:, 1:]] - turns[cells[:, :1]]) < 1e-9 * self.h**2  # along the hull
        self._more(ring[cells[(middles >= 0) & (middles < wall.length) & ~flat_ones] % len(flat)], number)

    def closed(self) -> Body:
        """Return the body with its lids."""
        lids = Lid(self.walls, 0.0, -1.0), Lid(self.walls, self.height, 1.0)
        for side, lid in enumerate(lids):
            number = len(self.walls) + side
            rims = [rim[side] for rim in self.rims]
            loops = [np.array([self.points[row] for row in rim])[:, :2] for rim in rims]
            found, cells = polygon(UNDIVIDED * self.h, *loops, seed=number)
            inner = self._new(_at(found[sum(map(len, rims)) :], lid.z), number)
            self._more(np.concatenate([*rims, inner])[cells][:, :: int(lid.up)], number)
        which = np.array(self.of_points, dtype=np.int64), np.array(self.of_cells, dtype=np.int64)
        return Body(np.array(self.points), np.array(self.cells, dtype=np.int64), (*self.walls, *lids), *which)


def _at(places: Points, z: float) -> Points:
    """Return places (k,) or (k, 2) with one more coordinate."""
    return np.column_stack([places, np.full(len(places), z)])


BODIES: dict[str, Callable[[], Body]] = {
    "ellipsoid": lambda: ellipsoid(4),
    "torus": lambda: torus(80, 30),
    "bumps": lambda: bumps(71),
    "cylinder": lambda: worsened(cylinder(0.1), 0.5, 4.0),
    "part": lambda: worsened(part(0.1), 0.5, 4.0),
}
