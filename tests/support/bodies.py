"""Valid meshes of many kinds, made of random numbers: of one part or several, which may touch but do not overlap."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import generate
import numpy as np
from geometries import circle, grid, polygon, positive, shell
from numpy.typing import NDArray
from scipy.spatial import Delaunay

Points = NDArray[np.float64]
Cells = NDArray[np.int64]
Random = np.random.Generator

SQUARE = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
COARSEST = 8  # segments of a circle: parts that touch in coarser ones interpenetrate by more than counts as contact
FINE = 16  # segments with which no tetrahedron of a pin's plate lies between a chord and its arc
SOUND = 1e-9  # determinant, of the product of the edges, at the corner where that is smallest


@dataclass(frozen=True, eq=False)
class Body:
    """Points (n, d), simplices (m, d+1), and cells (k, corners) of other types by their names."""

    points: Points
    cells: Cells
    others: Mapping[str, Cells] = field(default_factory=dict)

    @property
    def dimension(self) -> int:
        return self.points.shape[1]

    @property
    def size(self) -> float:
        return float(np.ptp(self.points, axis=0).max())

    @property
    def middles(self) -> Points:
        return self.points[self.cells].mean(axis=1)

    def moved(self, points: Points) -> Body:
        return replace(self, points=points)

    def turned(self) -> Body:
        """Number it the other way round."""
        return replace(self, cells=self.cells[:, [1, 0, *range(2, self.dimension + 1)]])

    def taken_apart(self) -> Body:
        """Give each simplex points of its own."""
        cells = np.arange(self.cells.size).reshape(self.cells.shape)
        return Body(self.points[self.cells].reshape(-1, self.dimension), cells)

    def part(self, chosen: NDArray[np.bool_] | Cells) -> Body:
        """Keep some simplices, and the points that they have."""
        used, rows = np.unique(self.cells[chosen], return_inverse=True)
        return Body(self.points[used], rows.reshape(-1, self.dimension + 1))


def together(*bodies: Body) -> Body:
    starts = np.cumsum([0, *(len(body.points) for body in bodies)])
    cells = [body.cells + start for body, start in zip(bodies, starts, strict=False)]
    return Body(np.concatenate([body.points for body in bodies]), np.concatenate(cells))


def facets(cells: Cells) -> tuple[Cells, Cells]:
    """Return all facets (k, d) and the simplices (k, 2) on both sides, -1 where there is none."""
    m, corners = cells.shape
    every = np.sort(np.concatenate([np.delete(cells, k, axis=1) for k in range(corners)]), axis=1)
    owner = np.tile(np.arange(m), corners)
    order = np.lexsort(every.T)
    every, owner = every[order], owner[order]
    same = (every[1:] == every[:-1]).all(axis=1)
    first = np.flatnonzero(np.concatenate([[True], ~same]))
    paired = np.append(same, False)[first]
    other = np.where(paired, np.append(owner, -1)[first + 1], -1)
    return every[first], np.column_stack([owner[first], other])


def inner(body: Body) -> Cells:
    """Return the vertices that are on no facet of one simplex only."""
    every, sides = facets(body.cells)
    return np.setdiff1d(body.cells, every[sides[:, 1] < 0])


def parts(body: Body) -> Cells:
    """Return the number (m,) of the part of each simplex; parts are joined through facets."""
    _, sides = facets(body.cells)
    number, inside = np.arange(len(body.cells)), sides[sides[:, 1] >= 0].T
    while True:
        before = number.copy()
        for one, other in (inside, inside[::-1]):
            np.minimum.at(number, one, before[other])
        if (number == before).all():
            return np.unique(number, return_inverse=True)[1].reshape(-1)


def is_sound(body: Body) -> bool:
    """Whether all simplices are of one sign in each part, and none has a size that rounding could make."""
    corners = body.points[body.cells]
    edges = corners[:, :, None] - corners[:, None]
    lengths = np.linalg.norm(edges, axis=3)
    lengths[:, range(lengths.shape[1]), range(lengths.shape[1])] = 1.0
    share = np.linalg.det(corners[:, 1:] - corners[:, :1]) / lengths.prod(axis=2).min(axis=1)
    wrong = [np.bincount(parts(body), weights=sign * share < SOUND) > 0 for sign in (1, -1)]
    return not (wrong[0] & wrong[1]).any()


def jittered(random: Random, body: Body, share: float) -> Body:
    """Move all vertices by a share of the shortest edge at each; by less, where that would invert elements."""
    d = body.dimension
    shortest = np.full(len(body.points), np.inf)
    for i in range(d + 1):
        for j in range(i):
            ends = body.cells[:, [i, j]].T
            length = np.linalg.norm(body.points[ends[0]] - body.points[ends[1]], axis=1)
            for end in ends:
                np.minimum.at(shortest, end, length)
    way = random.uniform(-share, share, body.points.shape) * np.where(np.isfinite(shortest), shortest, 0.0)[:, None]
    while not is_sound(body.moved(body.points + way)):
        way /= 2
    return body.moved(body.points + way)


def opened(body: Body, cut: NDArray[np.bool_]) -> Body:
    """Open a mesh at some of its facets, in the order of `facets`: their vertices become several at one place."""
    _, sides = facets(body.cells)
    m, corners = body.cells.shape
    parent = np.arange(m * corners)  # corners of simplices, joined through the facets that are not cut

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = int(parent[i])
        return i

    for s, t in sides[(sides[:, 1] >= 0) & ~cut].tolist():
        for i, vertex in enumerate(body.cells[s].tolist()):
            for j in np.flatnonzero(body.cells[t] == vertex).tolist():
                parent[root(s * corners + i)] = root(t * corners + j)
    roots = np.array([root(i) for i in range(m * corners)])
    _, first, rows = np.unique(roots, return_index=True, return_inverse=True)
    return Body(body.points[body.cells.ravel()[first]], rows.reshape(m, corners))


def slit(random: Random, body: Body) -> Body:
    """Open a mesh along some of the facets near a plane."""
    height, along = ((body.middles - body.middles.mean(axis=0)) @ random.standard_normal(body.dimension) for _ in "ab")
    _, sides = facets(body.cells)
    across = (sides[:, 1] >= 0) & ((height[sides[:, 0]] > 0) != (height[sides[:, 1]] > 0))
    return opened(body, across & (along[sides[:, 0]] < np.median(along)))


def in_pieces(random: Random, body: Body) -> Body:
    """Cut a mesh along the facets near one plane, or two that cross: pieces in contact, vertex to vertex."""
    ways = random.standard_normal((int(random.integers(1, 3)), body.dimension))
    sides_of = ((body.middles - body.middles.mean(axis=0)) @ ways.T > 0) @ np.array([1, 2])[: len(ways)]
    _, sides = facets(body.cells)
    return opened(body, (sides[:, 1] >= 0) & (sides_of[sides[:, 0]] != sides_of[sides[:, 1]]))


def plate(random: Random) -> Body:
    points, cells = generate.plate(random.uniform(0.3, 0.45), seed=int(random.integers(1000)))
    return jittered(random, Body(points, cells.astype(np.int64)), 0.2)


def bracket(random: Random) -> Body:
    points, cells = generate.bracket(random.uniform(0.45, 0.6), int(random.integers(2, 4)))
    return jittered(random, Body(points, cells.astype(np.int64)), 0.1)


def block(random: Random) -> Body:
    points, cells = grid(*[np.linspace(0, 1, k) for k in random.integers(4, 6, 3).tolist()])
    return jittered(random, Body(points, cells.astype(np.int64)), 0.1)


def cloud(random: Random, d: int) -> Body:
    """Return a Delaunay mesh of random points, with very flat elements; in the plane its hull is round."""
    while True:
        points = random.uniform(-1, 1, (int(random.integers(12, 60)), d))
        if d == 2:
            points = np.concatenate([0.7 * points, circle(0, 0, 1.0, int(random.integers(5, 16)))])
        body = Body(points, positive(points, Delaunay(points).simplices).astype(np.int64))
        if is_sound(body):
            return body


def meshed(random: Random, h: float, *loops: Points) -> Body:
    """Mesh the region between loops."""
    points, cells = polygon(h, *loops, seed=int(random.integers(1000)))
    return Body(points, cells.astype(np.int64))


def corner(random: Random) -> Body:
    a, b = random.uniform(0.5, 1.5, 2)
    loop = np.array([(0, 0), (2, 0), (2, a), (b, a), (b, 2), (0, 2)])
    return jittered(random, meshed(random, random.uniform(0.25, 0.4), loop), 0.15)


def thick(random: Random, body: Body, low: float = 0.0, high: float = 1.0, layers: int = 2) -> Body:
    """Return the tetrahedra above a plane mesh, in layers of different heights."""
    inside = np.linspace(low, high, layers + 1)[1:-1] + random.uniform(-0.2, 0.2, layers - 1) * (high - low) / layers
    points, cells = generate.extruded(body.points, body.cells.astype(np.int32), np.array([low, *inside, high]))
    return Body(points, cells.astype(np.int64))


def hole_and_pin(random: Random, least: int, most: int) -> tuple[Body, Body]:
    """Return a plate and a pin in its hole, or a ring, with different numbers of segments."""
    radius, (one, other) = random.uniform(0.3, 0.7), random.integers(least, most, 2).tolist()
    loops = [turned_by(random, circle(0, 0, radius, other)) + 1.0]
    if random.random() < 0.3:
        loops.append(circle(1.0, 1.0, radius * random.uniform(0.3, 0.5), other))
    hole = turned_by(random, circle(0, 0, radius, one)) + 1.0
    edge = 2 * radius * np.sin(np.pi / other)  # so fine that no triangle of the pin lies between a chord and its arc
    return meshed(random, random.uniform(0.3, 0.5), SQUARE, hole), meshed(random, edge, *loops)


def pin_in_space(random: Random, least: int, most: int) -> Body:
    hole, pin = hole_and_pin(random, least, most)
    low, high = random.uniform(-0.2, 0.5), random.uniform(0.7, 1.2)
    return together(thick(random, hole, 0.0, 0.8), thick(random, pin, low, high))


def bushing(random: Random) -> Body:
    """Return a plate, a thin ring in its hole and a pin in the ring, with different numbers of segments."""
    hole, ring, pin = (circle(0, 0, 0.5, int(random.integers(COARSEST, 40))) for _ in range(3))
    inside, i = random.uniform(0.7, 0.96), np.arange(len(ring))
    j, k = (i + 1) % len(ring), i + len(ring)
    points = np.concatenate([ring, inside * ring])
    cells = positive(points, np.concatenate([np.column_stack([i, j, k]), np.column_stack([j, j + len(ring), k])]))
    return together(
        meshed(random, 0.4, SQUARE - 1.0, turned_by(random, hole)),
        Body(points, cells.astype(np.int64)),
        meshed(random, inside * np.sin(np.pi / len(pin)), turned_by(random, inside * pin)),
    )


def with_a_gap(random: Random) -> Body:
    """Return a plate and a part in its hole that it does not touch."""
    radius, (one, other) = random.uniform(0.3, 0.7), random.integers(12, 24, 2).tolist()
    within = radius * random.uniform(0.2, 0.9)
    around = meshed(random, 0.4, SQUARE, circle(1.0, 1.0, radius, one))
    return together(around, meshed(random, min(0.4, within), turned_by(random, circle(0, 0, within, other)) + 1.0))


def in_a_cavity(random: Random) -> Body:
    """Return a block with a cavity, and a part in it."""
    points, cells = grid(*[np.arange(4.0)] * 3)
    middles = points[cells].mean(axis=1)
    hollow = Body(points, cells[~((middles > 1) & (middles < 2)).all(axis=1)].astype(np.int64))
    part = cloud(random, 3)
    return together(jittered(random, hollow, 0.05), part.moved(1.5 + 0.35 * part.points))


def ball_and_socket(random: Random) -> Body:
    """Return a ball in a shell, both with flat facets, which are not the same."""
    points, cells = shell()
    outer = Body(points, cells.astype(np.int64)).part((np.linalg.norm(points[cells], axis=2) < 0.75).all(axis=1))
    radius = np.linalg.norm(outer.points, axis=1).min()
    count = int(random.integers(60, 200))
    share = (np.arange(count) + 0.5) / count
    turn, height = np.pi * (1 + 5**0.5) * count * share, 1 - 2 * share
    flat = np.sqrt(1 - height**2)
    ball = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])
    within = 0.6 * ball[::3] + 0.03 * random.standard_normal(ball[::3].shape)
    ball = radius * np.concatenate([ball, within, np.zeros((1, 3))])
    return together(outer, Body(ball, positive(ball, Delaunay(ball).simplices).astype(np.int64)))


def side_by_side(random: Random, d: int) -> Body:
    """Return two blocks that touch in a face or a share of it and divide it differently; one may be much finer."""
    one, other = (grid(*[np.linspace(0, 1, k + 1) for k in random.integers(1, 7, d).tolist()]) for _ in range(2))
    size = random.choice([1.0, 10.0 ** random.uniform(-5, 0)])
    shift = np.array([1.0, *random.uniform(0, 0.9, d - 1)])
    return together(Body(one[0], one[1].astype(np.int64)), Body(size * other[0] + shift, other[1].astype(np.int64)))


def needles(random: Random, d: int) -> Body:
    """Return a grid with layers as thin as 2^-27 of it, in numbers that are exact."""
    thin = 2.0 ** -random.integers(6, 28)
    axes = [np.arange(int(random.integers(2, 5))) / 4.0 for _ in range(d)]
    axes[int(random.integers(d))] = np.array([0.0, thin, 2 * thin, 0.5, 1.0])
    points, cells = grid(*axes)
    return Body(points, cells.astype(np.int64))


def far_apart(random: Random, d: int) -> Body:
    """Return two parts of different sizes that are not near each other."""
    one, other = cloud(random, d), cloud(random, d)
    size = 10.0 ** random.uniform(-4, 0)
    return together(one, other.moved(size * other.points + 10.0 ** random.uniform(0.7, 4)))


def mirrored(random: Random, d: int) -> Body:
    """Return a part and its mirror image, which touch; the image is numbered the other way round."""
    axes = [np.arange(float(k)) for k in random.integers(4, 6, d).tolist()]
    points, cells = grid(*axes)
    image = points * np.array([-1.0] + [1.0] * (d - 1))
    return together(Body(points, cells.astype(np.int64)), Body(image, cells.astype(np.int64)))


def turned_by(random: Random, points: Points) -> Points:
    a = random.uniform(0, 2 * np.pi)
    return points @ np.array([(np.cos(a), np.sin(a)), (-np.sin(a), np.cos(a))])


PLANE: dict[str, Callable[[Random], Body]] = {
    "plate": plate,
    "cloud": lambda random: cloud(random, 2),
    "corner": corner,
    "slit": lambda random: slit(random, corner(random)),
    "in pieces": lambda random: in_pieces(random, plate(random)),
    "taken apart": lambda random: corner(random).taken_apart(),
    "pin in a hole": lambda random: together(*hole_and_pin(random, COARSEST, 30)),
    "gap": with_a_gap,
    "side by side": lambda random: side_by_side(random, 2),
    "needles": lambda random: needles(random, 2),
    "far apart": lambda random: far_apart(random, 2),
    "mirrored": lambda random: mirrored(random, 2),
    "all turned": lambda random: plate(random).turned(),
}
SOLID: dict[str, Callable[[Random], Body]] = {
    "bracket": bracket,
    "block": block,
    "cloud": lambda random: cloud(random, 3),
    "corner": lambda random: thick(random, corner(random)),
    "slit": lambda random: slit(random, bracket(random)),
    "in pieces": lambda random: in_pieces(random, cloud(random, 3)),
    "taken apart": lambda random: cloud(random, 3).taken_apart(),
    "pin in a hole": lambda random: pin_in_space(random, FINE, 22),
    "ball and socket": ball_and_socket,
    "cavity": in_a_cavity,
    "side by side": lambda random: side_by_side(random, 3),
    "needles": lambda random: needles(random, 3),
    "far apart": lambda random: far_apart(random, 3),
    "mirrored": lambda random: mirrored(random, 3),
    "all turned": lambda random: bracket(random).turned(),
}
BODIES = {2: PLANE, 3: SOLID}
