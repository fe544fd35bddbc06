"""Where a surface is tangled or was, and what there only seems to be a feature.

A vertex that left its place along a surface is still on it: all vertices together sample the surface, however folded
the elements between them are. Where they are near a quadric no sharp edge passes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.patches import dots, unit_vectors
from meshfix_cli.mesh.sides import normals_around, rows_of_elements

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]
RINGS = 3  # around inverted elements: as far a vertex that left its place may feign a feature
LONG = 20  # vertices of features that go on in each other: no tangle feigns so many
SMOOTH = 0.1  # of their size: of what is no quadric to this, such as an edge, nothing is told
# What the quadric leaves of the points around a vertex, of their size: an edge at a right angle leaves 0.03 and more, a
# smooth surface seldom as much as the second, and hardly ever the first where the vertices are in a long row.
PLAIN, SHARP = 0.008, 0.02
GOES_ON = -0.6  # the largest cosine between the ways from a vertex on a feature to two others
# How far a corner is from the quadric, of what the farthest point around it is: by itself, and where rows meet there.
CREST, CORNER = 1.0, 0.25
SPUR = 3  # vertices of a row that leads from a feature to nowhere


@dataclass(frozen=True, eq=False)
class Tangle:
    """Where vertices are that a tangle has moved, and the surface that all of them were on at first.

    Attributes
    ----------
    region, features, always, certain : (k,) bool
        In the order of the connectivity: where that is; the vertices on features of the surface, boundaries among them;
        those that are on them by topology, labels and lines, or held; and those that rows of others go through.
    sample : kernels.Sample
    """

    region: Mask
    features: Mask
    always: Mask
    certain: Mask
    sample: kernels.Sample

    @classmethod
    def of(cls, mesh: Mesh, threads: int = 1) -> Tangle:
        """Return that of a surface as it came, as `surface.laid_out` gives it."""
        assert mesh.freedom is not None
        points, normals = mesh.along_curve(mesh.points), normals_of_vertices(mesh, threads)
        sample, always, region = kernels.Sample(points, normals), _always(mesh), tangled(mesh, threads)
        on_features = (mesh.freedom.degrees < 2) | always
        doubtful = on_features & region & ~always
        rows = np.flatnonzero(doubtful)
        left, share = np.full((2, len(points)), np.inf)
        left[rows], share[rows] = sample.left(points[rows], normals[rows], threads).T
        start, end = mesh.topology.edges()
        sure = on_features & (left >= PLAIN)
        sure &= (left >= SHARP) | _go_on(sure, start, end)
        share[mesh.freedom.degrees > 0] = 0.0
        found, needed = _in_rows(sure, doubtful, share, points, start, end)
        return cls(region, found, always, found & (~doubtful | (mesh.freedom.degrees > 0) | (needed >= 2)), sample)

    @property
    def plain(self) -> Mask:
        """(k,) bool: the vertices of the tangle that are on no feature, though they may seem to be."""
        return np.asarray(self.region & ~(self.features | self.always))

    def with_moved(self, moved: Mask, mesh: Mesh, threads: int = 1) -> Tangle:
        """Return it with what has moved (k,) as well, and a ring around it."""
        return replace(self, region=self.region | mesh.topology.stars(threads).grown(moved, 1).view(bool))

    def without_doubtful(self, mesh: Mesh, threads: int = 1) -> Tangle:
        """Return it with those features alone, where elements are inverted still, that are certain."""
        return replace(self, features=self.features & (self.certain | ~_broken(mesh, threads)))

    def refitted(self, points: Array, rows: NDArray[np.integer], normals: Array, threads: int = 1) -> Array:
        """Return points (k, 3) of which some rows have come, along normals (k, 3), to the surface.

        It is a quadric of least squares through the nearest points of the sample that are seen from the same side; see
        kernels/surface/refit.hpp.
        """
        result = points.copy()
        if len(rows):
            self.sample.refit(result, rows.astype(np.int32), normals, SMOOTH, threads)
        return result


def tangled(mesh: Mesh, threads: int = 1) -> Mask:
    """Mark the vertices (k,) of inverted elements, in the order of the connectivity, and `RINGS` around them."""
    return mesh.topology.stars(threads).grown(_broken(mesh, threads), RINGS).view(bool)


def _broken(mesh: Mesh, threads: int) -> Mask:
    points, judged = mesh.along_curve(mesh.points), mesh.judged()
    broken = np.zeros(len(points), dtype=bool)
    broken[judged.vertices(judged.check(points, threads)[0])] = True
    return broken


def normals_of_vertices(mesh: Mesh, threads: int = 1) -> Array:
    """Return unit normals (k, 3) that what is around the vertices of the connectivity tells; 0: nothing does."""
    return normals_around(mesh.topology, mesh.along_curve(mesh.points), threads)[0]


def ends(mesh: Mesh) -> Mask:
    """Mark the vertices (k,) that are at the boundary, or held."""
    assert mesh.surface is not None and mesh.surface.kept is not None
    return np.asarray(mesh.surface.kept.held | mesh.along_curve(mesh.topology.boundary))


def _always(mesh: Mesh) -> Mask:
    """Mark the vertices (k,) that are held, at the boundary, on lines, and between labels."""
    assert mesh.surface is not None and mesh.surface.kept is not None
    found, kept = ends(mesh).copy(), mesh.surface.kept
    found[kept.lines] = True
    if (kept.labels != kept.labels[0]).any():
        offsets, nodes = rows_of_elements(mesh.topology)
        of_nodes = np.repeat(kept.labels, np.diff(offsets))
        least, most = np.full(len(found), of_nodes.max()), np.full(len(found), of_nodes.min())
        np.minimum.at(least, nodes, of_nodes)
        np.maximum.at(most, nodes, of_nodes)
        found |= least < most
    return found


def _go_on(found: Mask, start: Numbers, end: Numbers) -> Mask:
    """Mark the vertices (k,) that are joined to `LONG` that are found, by edges from start (e,) to end (e,)."""
    both = np.stack([start, end], axis=1)[found[start] & found[end]]
    chain = kernels.joined(both, len(found))
    return np.asarray(np.bincount(chain, found, len(found))[chain] >= LONG)


def _in_rows(
    found: Mask, doubtful: Mask, share: Array, points: Array, start: Numbers, end: Numbers
) -> tuple[Mask, NDArray[np.int64]]:
    """Return what is found (k,) without such that are doubtful and at the end of a short row of others, or beside one.

    Corners, where rows meet that end without them, stay; `share` (k,) tells of those that may be such how far they are
    from the quadric there, of what the farthest point around is. With it for how many neighbours each is the one that
    continues their row. The edges, from start (e,) to end (e,), join the points (k, 3).
    """
    here, there = np.concatenate([start, end]), np.concatenate([end, start])
    near = (found & doubtful)[here] & found[there]
    order = np.argsort(here[near], kind="stable")
    here, there = here[near][order], there[near][order]
    ways = unit_vectors(points[there] - points[here])
    for _ in range(SPUR):
        between, ending = _between(here, there, ways, len(found))
        beside = np.bincount(here, minlength=len(found))
        left = found & (~doubtful | between | ((share >= CREST) & (beside >= 2)) | ((share >= CORNER) & (ending >= 2)))
        if np.array_equal(left, found):
            break
        found = left
        near = found[here] & found[there]
        here, there, ways = here[near], there[near], ways[near]
    return found, ending


def _between(here: Numbers, there: Numbers, ways: Array, k: int) -> tuple[Mask, NDArray[np.int64]]:
    """Mark those of k vertices that are between two of their neighbours; count for each what is so by it alone.

    Edges (w,) lead from vertices, ascending, to neighbours, in directions (w, 3).
    """
    pairs = [np.empty((3, 0), dtype=np.int64)]
    for apart in range(1, len(here)):
        (first,) = np.nonzero(here[apart:] == here[:-apart])
        if not len(first):
            break
        first = first[dots(ways[first], ways[first + apart]) <= GOES_ON]
        pairs.append(np.stack([here[first], there[first], there[first + apart]]).astype(np.int64))
    middle, one, other = np.concatenate(pairs, axis=1)
    count = np.bincount(middle, minlength=k)
    key, times = np.unique(np.concatenate([middle * k + one, middle * k + other]), return_counts=True)
    alone = times == count[key // k]
    return count > 0, np.bincount(key[alone] % k, minlength=k)
