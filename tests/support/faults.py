"""Valid meshes with one fault each, which no verdict may overlook; None where a mesh has no place for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from bodies import Body, Cells, Points, Random, block, bracket, corner, facets, inner, parts, plate, together
from exact import signs
from scipy.spatial import cKDTree

# Of the longest facet of two parts: as deep in both their common place is, which a chord of a circle in contact is not.
DEEP = 0.25
# Of the longest edges of two simplices: the radius of a ball in both, which those in contact have not.
LARGE = 0.05
SAMPLES = 6  # on the edge of a facet


def is_tangled(body: Body) -> bool:
    """Whether a part has simplices of both signs, or one without size: no numbering makes all positive."""
    sign, part = signs(body.points, body.cells), parts(body)
    positive, negative = (np.bincount(part, weights=sign == one) > 0 for one in (1, -1))
    return bool((sign == 0).any() or (positive & negative).any())


def with_vertex(body: Body, vertex: int, place: Points) -> Body | None:
    points = body.points.copy()
    points[vertex] = place
    return body.moved(points) if is_tangled(body.moved(points)) else None


def neighbours(body: Body, vertex: int) -> Cells:
    return np.setdiff1d(body.cells[(body.cells == vertex).any(axis=1)], [vertex])


def thrown_over_a_neighbour(random: Random, body: Body, vertices: Cells, least: float = 0.05) -> Body | None:
    if not len(vertices):
        return None
    vertex = int(random.choice(vertices))
    over = body.points[random.choice(neighbours(body, vertex))]
    return with_vertex(body, vertex, over + random.uniform(least, 2.0) * (over - body.points[vertex]))


def free_vertex(random: Random, body: Body) -> Body | None:
    return thrown_over_a_neighbour(random, body, inner(body))


def fixed_vertex(random: Random, body: Body) -> Body | None:
    return thrown_over_a_neighbour(random, body, np.setdiff1d(body.cells, inner(body)))


def far_vertex(random: Random, body: Body) -> Body | None:
    """Throw a vertex 10^2 to 10^12 sizes away."""
    vertex, way = int(random.choice(np.unique(body.cells))), random.standard_normal(body.dimension)
    far = body.size * 10 ** random.uniform(2, 12) * way / np.linalg.norm(way)
    return with_vertex(body, vertex, body.points[vertex] + far)


def edge_without_length(random: Random, body: Body) -> Body | None:
    vertex = int(random.choice(np.unique(body.cells)))
    return with_vertex(body, vertex, body.points[random.choice(neighbours(body, vertex))])


def simplex_without_size(random: Random, body: Body) -> Body | None:
    """Put a vertex on the middle of an edge opposite it, where numbers can tell that exactly."""
    vertices = random.permutation(body.cells[random.integers(len(body.cells))])
    return with_vertex(body, int(vertices[0]), body.points[vertices[1:3]].sum(axis=0) / 2)


def misnumbered(random: Random, body: Body) -> Body | None:
    """Number a simplex against its neighbours."""
    part = parts(body)
    among = np.flatnonzero(np.bincount(part)[part] > 2)
    if not len(among):
        return None
    cells, row = body.cells.copy(), random.choice(among)
    cells[row, :2] = cells[row, 1::-1]
    return replace(body, cells=cells)


def another(random: Random, d: int) -> Body:
    kinds = (plate, corner) if d == 2 else (bracket, block)
    return kinds[int(random.integers(2))](random)


def boundary(body: Body) -> tuple[Points, float]:
    """Return places all over the boundary, and the longest edge in it."""
    every, sides = facets(body.cells)
    corners, d = body.points[every[sides[:, 1] < 0]], body.dimension
    steps = np.stack(np.meshgrid(*[np.arange(SAMPLES + 1)] * (d - 1)), axis=-1).reshape(-1, d - 1)
    steps = steps[steps.sum(axis=1) <= SAMPLES] / SAMPLES
    weights = np.column_stack([1 - steps.sum(axis=1), steps])
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    return np.einsum("ks,fsd->fkd", weights, corners).reshape(-1, d), float(longest)


def places(body: Body) -> tuple[Points, Points, float]:
    """Return vertices and middles of simplices, how deep below the boundary they are, and its longest edge."""
    found, (samples, longest) = np.concatenate([body.points[inner(body)], body.middles]), boundary(body)
    return found, cKDTree(samples).query(found)[0] - longest / SAMPLES, longest


def overlapping(random: Random, body: Body, other: Body) -> Body | None:
    """Put a deep place of one part on one of another."""
    (mine, depth, longest), (theirs, other_depth, other_longest) = places(body), places(other)
    least = DEEP * max(longest, other_longest)
    mine, theirs = mine[depth > least], theirs[other_depth > least]
    if not len(mine) or not len(theirs):
        return None
    return together(body, other.moved(other.points + random.choice(mine) - random.choice(theirs)))


def overlap(random: Random, body: Body) -> Body | None:
    return overlapping(random, body, another(random, body.dimension))


def mirrored_overlap(random: Random, body: Body) -> Body | None:
    return overlapping(random, body, another(random, body.dimension).turned())


def shrunk(other: Body, place: Points, radius: float) -> Body:
    centred = other.points - other.points.mean(axis=0)
    return other.moved(place + 0.9 * radius / np.linalg.norm(centred, axis=1).max() * centred)


def heights(corners: Points) -> Points:
    """Return the heights (m, d+1) of simplices (m, d+1, d)."""
    size = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    below = []
    for k in range(corners.shape[1]):
        facet = np.delete(corners, k, axis=1)
        edges = facet[:, 1:] - facet[:, :1]
        below.append(np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1))))
    return size[:, None] / np.column_stack(below)


def part_in_a_simplex(random: Random, body: Body) -> Body | None:
    _, depth, _ = places(body)
    among = np.flatnonzero((depth[-len(body.cells) :] > 0) | (parts(body).max() == 0))  # not where parts touch
    if not len(among):
        return None
    row = int(random.choice(among))
    radius = heights(body.points[body.cells[[row]]]).min() / (body.dimension + 1)
    return together(body, shrunk(another(random, body.dimension), body.middles[row], float(radius)))


def part_around(random: Random, body: Body) -> Body | None:
    """Put all of it around an inner vertex of a larger part."""
    other = another(random, body.dimension)
    if not len(inner(other)):
        return None
    larger = 1e3 * body.size * (other.points - other.points[inner(other)[0]])
    return together(body, other.moved(larger + body.points.mean(axis=0)))


def part_across_a_facet(random: Random, body: Body) -> Body | None:
    """Put a small part deep inside of a larger one, where two simplices without a free vertex meet."""
    every, sides = facets(body.cells)
    at = body.points[every].mean(axis=1)
    samples, longest = boundary(body)
    deep = cKDTree(samples).query(at)[0] > DEEP * longest
    among = np.flatnonzero((sides[:, 1] >= 0) & ~np.isin(every, inner(body)).any(axis=1) & deep)
    if not len(among):
        return None
    row = random.choice(among)
    radius = heights(body.points[body.cells[sides[row]]]).min() / (2 * body.dimension + 2)
    return together(body, shrunk(another(random, body.dimension), at[row], float(radius)))


def copy(random: Random, body: Body) -> Body | None:
    """Add the same once more, with points of its own and in another order."""
    other = body.part(random.permutation(len(body.cells)))
    return together(body, other.turned() if random.random() < 0.3 else other)


def two_with_a_common_piece(random: Random, body: Body) -> Body | None:
    """Let two parts of a mesh have some of its simplices both, with points of their own: only corners cross."""
    height = body.middles @ random.standard_normal(body.dimension)
    low, high = np.quantile(height, np.sort(random.uniform(0.1, 0.9, 2)))
    one, other = height <= high, height >= low
    return together(body.part(one), body.part(other)) if (one & other).any() and not (one & other).all() else None


def tangled_apart(random: Random, body: Body) -> Body | None:
    """Tangle a mesh of which each simplex has points of its own."""
    tangled = thrown_over_a_neighbour(random, body, inner(body))
    return None if tangled is None else tangled.taken_apart()


def tangled_apart_and_renumbered(random: Random, body: Body) -> Body | None:
    """Do the same, and number each simplex so that it is positive: they overlap all the same."""
    body = another(random, body.dimension)
    tangled = thrown_over_a_neighbour(random, body, inner(body), 0.5)
    if tangled is None:
        return None
    around = (tangled.points != body.points).any(axis=1)[body.cells].any(axis=1)
    apart, sign = tangled.taken_apart(), signs(tangled.points, tangled.cells)
    result = replace(apart, cells=np.where(sign[:, None] < 0, apart.turned().cells, apart.cells))
    return (
        result
        if (sign != 0).all() and largest_common_ball(random, result.points[result.cells[around]]) > LARGE
        else None
    )


def largest_common_ball(random: Random, corners: Points) -> float:
    """Return the radius, in longest edges, of a ball in two of these simplices (m, d+1, d), found around samples."""
    height, d = heights(corners), corners.shape[2]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    weights = random.dirichlet(np.full(d + 1, 1.5), size=40)
    samples = np.einsum("kc,scd->skd", weights, corners)
    shares = np.einsum(
        "skmi,mij->skmj", samples[:, :, None] - corners[:, 0], np.linalg.inv(corners[:, 1:] - corners[:, :1])
    )
    theirs = (np.concatenate([1 - shares.sum(axis=3, keepdims=True), shares], axis=3) * height).min(axis=3)
    mine = (weights * height[:, None]).min(axis=2)
    theirs[np.eye(len(corners), dtype=bool)[:, None].repeat(40, axis=1)] = 0.0
    return float((np.minimum(theirs, mine[:, :, None]) / np.maximum(longest, longest[:, None])[:, None]).max())


def inside_out(random: Random, body: Body, name: str) -> Body:
    """Add an element of another type at the boundary that lies on the wrong side of it, or is twisted."""
    every, sides = facets(body.cells)
    row = int(random.choice(np.flatnonzero(sides[:, 1] < 0)))
    facet, owner = every[row], sides[row, 0]
    corners, n = body.points[facet], len(body.points)
    edges = corners[1:] - corners[0]
    normal = np.array([edges[0, 1], -edges[0, 0]]) if len(edges) == 1 else np.cross(*edges)
    height = normal * np.linalg.norm(edges[0]) / np.linalg.norm(normal) * random.uniform(0.3, 1.5)
    inwards = height if (body.middles[owner] - corners[0]) @ normal > 0 else -height
    twisted = random.random() < 0.5
    if name == "hexahedron":
        corners = np.concatenate([corners, corners[:1] + corners[2:] - corners[1:2]])
        facet = np.append(facet, n)
    lifted = corners[: 2 if name == "pyramid" else None] + (-inwards if twisted else inwards)
    points = np.concatenate([body.points, corners[len(every[row]) :], lifted])
    above = np.arange(len(points) - len(lifted), len(points))
    if twisted:
        above[:2] = above[1::-1]
    if name == "pyramid":
        cell = np.array([facet[0], facet[1], above[1], above[0], facet[2]])
    else:
        cell = np.concatenate([facet, above[::-1] if name == "quad" else above])
    return Body(points, body.cells, {name: cell[None]})


def other_type(random: Random, body: Body) -> Body | None:
    names = ["quad"] if body.dimension == 2 else ["pyramid", "wedge", "hexahedron"]
    return inside_out(random, body, str(random.choice(names)))


FAULTS: dict[str, Callable[[Random, Body], Body | None]] = {
    "free vertex": free_vertex,
    "fixed vertex": fixed_vertex,
    "far vertex": far_vertex,
    "edge without length": edge_without_length,
    "simplex without size": simplex_without_size,
    "misnumbered": misnumbered,
    "overlap": overlap,
    "mirrored overlap": mirrored_overlap,
    "part in a simplex": part_in_a_simplex,
    "part around": part_around,
    "part across a facet": part_across_a_facet,
    "copy": copy,
    "two with a common piece": two_with_a_common_piece,
    "tangled apart": tangled_apart,
    "tangled apart and renumbered": tangled_apart_and_renumbered,
    "other type": other_type,
}
