"""A simplicial mesh as a value: what moves (`Mesh.points`) and what does not (`Topology`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshfix_cli import _kernels
from meshfix_cli.errors import InvalidMeshError

_T = TypeVar("_T", bound=np.generic)

# Squares and sixth powers of lengths must neither overflow nor vanish in double precision.
LARGEST_COORDINATE = 1e45
SMALLEST_SIZE = 1e-45

CELL_NAMES = {2: ("triangle", "triangles"), 3: ("tetrahedron", "tetrahedra")}
FACET_NAMES = {2: "edge", 3: "triangle"}


@dataclass(frozen=True, eq=False)
class Topology:
    """Connectivity, computed once and shared by every position of the points.

    Attributes
    ----------
    simplices : (m, d+1) int32
        Vertices of each simplex, positively oriented.
    n : int
        Number of points.
    source : (m,) int64
        The row of the user's array behind each simplex (repeated simplices are left out).
    flipped : (m,) bool
        True where the user's numbering has the other orientation.
    component : (m,) int32
        Simplices joined through facets have the same number.
    mates : (m, d+1) int32
        The corner across the facet opposite each corner, -1 on the boundary; corner = simplex * (d+1) + position.
    """

    simplices: NDArray[np.int32]
    n: int
    source: NDArray[np.int64]
    flipped: NDArray[np.bool_]
    component: NDArray[np.int32]
    mates: NDArray[np.int32]

    @property
    def dimension(self) -> int:
        """2 for triangles, 3 for tetrahedra."""
        return self.simplices.shape[1] - 1

    @cached_property
    def stars(self) -> _kernels.Stars:
        """Incidence, neighbours, blocks and block colours."""
        try:
            return _kernels.Stars(self.simplices, self.n)
        except ValueError as error:  # a star, or the mesh, is too large to be numbered
            raise InvalidMeshError(str(error)) from error

    @cached_property
    def colours(self) -> list[NDArray[np.int32]]:
        """The blocks of each colour; no two blocks of one colour share an edge."""
        return np.split(self.stars.colour_blocks, self.stars.colour_offsets[1:-1])

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """(n,) bool: the vertices of simplices; other points are isolated."""
        return self.mark(self.simplices)

    @cached_property
    def boundary(self) -> NDArray[np.bool_]:
        """(n,) bool: vertices of facets that belong to one simplex."""
        return self._mark_facets(self.mates < 0)

    @cached_property
    def mirrored(self) -> NDArray[np.bool_]:
        """(m,) bool: simplices of components whose numbering has, for most, the other orientation.

        Components without an inner vertex have that of the whole mesh.
        """
        votes = np.bincount(self.component, weights=self.flipped * 2.0 - 1.0)
        inner = (self.used & ~self.boundary)[self.simplices].any(axis=1)
        # Without an inner vertex a part is its boundary: that may be tangled as well as mirrored, so all parts vote.
        by_itself = np.bincount(self.component, weights=inner) > 0
        return np.where(by_itself, votes > 0, votes.sum() > 0)[self.component]

    @property
    def misnumbered(self) -> NDArray[np.bool_]:
        """(m,) bool: simplices numbered against most of their component: inverted for whoever reads the file."""
        return self.flipped != self.mirrored

    def interface(self, regions: ArrayLike) -> NDArray[np.bool_]:
        """(n,) bool: vertices of facets between simplices of different regions; `regions` (m,) labels."""
        labels = np.asarray(regions)
        across = labels[self.mates // (self.dimension + 1)]
        return self._mark_facets((self.mates >= 0) & (across != labels[:, None]))

    def grown(self, vertices: NDArray[np.bool_], rings: int) -> NDArray[np.bool_]:
        """(n,) bool: these vertices and `rings` rings of neighbours around them."""
        grown = vertices.copy()
        for _ in range(rings):
            grown[self.simplices[grown[self.simplices].any(axis=1)]] = True
        return grown

    def facet_pairs(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the two simplices at each interior facet."""
        corner = np.flatnonzero(self.mates.ravel() > np.arange(self.mates.size))
        mate = self.mates.ravel()[corner]
        return (corner // (self.dimension + 1)).astype(np.int32), mate // np.int32(self.dimension + 1)

    def mark(self, vertices: NDArray[np.int32]) -> NDArray[np.bool_]:
        """(n,) bool: these vertices."""
        mask = np.zeros(self.n, dtype=bool)
        mask[vertices] = True
        return mask

    def _mark_facets(self, facets: NDArray[np.bool_]) -> NDArray[np.bool_]:
        mask = np.zeros(self.n, dtype=bool)
        for position in range(self.dimension + 1):
            others = np.delete(self.simplices, position, axis=1)
            mask[others[facets[:, position]]] = True
        return mask


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points and their topology; immutable, a moved mesh is a new one.

    Attributes
    ----------
    points : (n, d) float64
        Positions in model units, read-only.
    topology : Topology
    movable : (n,) bool
        The free vertices.
    """

    points: NDArray[np.float64]
    topology: Topology
    movable: NDArray[np.bool_]

    @classmethod
    def build(cls, points: ArrayLike, simplices: ArrayLike, fixed: ArrayLike | None = None) -> Mesh:
        """Check the arrays, orient the simplices and fix the boundary.

        Parameters
        ----------
        points : (n, d) float
            d = 2 for triangles, 3 for tetrahedra.
        simplices : (m, d+1) int
            Numbered either way round; see `Topology.flipped`.
        fixed : (n,) bool, optional
            Vertices that must not move, beside those of the boundary.

        Raises
        ------
        InvalidMeshError
            Wrong shapes, no simplices, indices out of range, coordinates that are not finite or too large,
            a simplex that names a vertex twice, a facet of more than two simplices, a Moebius band.
        """
        p = np.array(points, dtype=np.float64, order="C")
        rows = _checked_simplices(p, np.asarray(simplices))
        _check_coordinates(p, rows)
        topology = _build_topology(p, rows)
        movable = topology.used & ~topology.boundary
        if fixed is not None:
            movable &= ~np.asarray(fixed, dtype=bool)
        return cls(_read_only(p), topology, _read_only(movable))

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.points.shape[1]

    def with_points(self, points: NDArray[np.float64]) -> Mesh:
        """Return the same mesh with other positions (n, d) float64; the array becomes read-only."""
        if points.shape != self.points.shape or points.dtype != np.float64:
            raise ValueError(f"points have the shape {points.shape}, and this mesh {self.points.shape}")
        return replace(self, points=_read_only(points))

    def with_fixed(self, fixed: NDArray[np.bool_]) -> Mesh:
        """Return the same mesh with more vertices fixed, `fixed` (n,) bool."""
        return replace(self, movable=_read_only(self.movable & ~fixed))

    def check(self, threads: int = 1) -> tuple[int, float]:
        """Return the number of inverted simplices and the smallest signed area or volume, in model units."""
        return _kernels.check(self.points, self.topology.simplices, threads)

    def mean_edge_length(self) -> float:
        """Return h of the paper's section 4: the mean length of the distinct edges, in model units."""
        stars = self.topology.stars
        start = np.repeat(np.arange(self.topology.n, dtype=np.int32), np.diff(stars.neighbour_offsets))
        once = start < stars.neighbours
        edges = self.points[stars.neighbours[once]] - self.points[start[once]]
        return float(np.linalg.norm(edges, axis=1).mean())


def _read_only(array: NDArray[_T]) -> NDArray[_T]:
    array.flags.writeable = False
    return array


def _checked_simplices(points: NDArray[np.float64], simplices: NDArray[np.integer[Any]]) -> NDArray[np.int32]:
    """Check shapes and indices; return the simplices as (m, d+1) int32."""
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InvalidMeshError(f"points have the shape {points.shape}; (n, 2) or (n, 3) is needed")
    n, d = points.shape
    if simplices.ndim != 2 or simplices.shape[1] != d + 1 or simplices.dtype.kind not in "iu":
        raise InvalidMeshError(f"simplices have the shape {simplices.shape}; (m, {d + 1}) integers are needed")
    if len(simplices) == 0:
        raise InvalidMeshError("the mesh has no elements")
    if simplices.size >= 2**31 or n >= 2**31:
        raise InvalidMeshError("the mesh is too large: 536 million tetrahedra are the limit")
    outside = ((simplices < 0) | (simplices >= n)).any(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        raise InvalidMeshError(f"element {row} refers to vertices {simplices[row].tolist()}, but there are {n} points")
    for i, j in combinations(range(d + 1), 2):
        repeated = simplices[:, i] == simplices[:, j]
        if repeated.any():
            row = int(np.argmax(repeated))
            raise InvalidMeshError(f"element {row} names a vertex twice: {simplices[row].tolist()}")
    return np.array(simplices, dtype=np.int32, order="C")


def _check_coordinates(points: NDArray[np.float64], simplices: NDArray[np.int32]) -> None:
    used = np.zeros(len(points), dtype=bool)
    used[simplices] = True
    infinite = used & ~np.isfinite(points).all(axis=1)
    if infinite.any():
        vertex = int(np.argmax(infinite))
        raise InvalidMeshError(f"vertex {vertex} has a coordinate that is not finite")
    low, high = points[used].min(axis=0), points[used].max(axis=0)
    if max(-low.min(), high.max()) > LARGEST_COORDINATE:
        raise InvalidMeshError(f"coordinates beyond {LARGEST_COORDINATE:g} cannot be computed with")
    if (high - low).max() < SMALLEST_SIZE:
        raise InvalidMeshError("all vertices are in one point")


def _build_topology(points: NDArray[np.float64], simplices: NDArray[np.int32]) -> Topology:
    n, d = points.shape
    source = np.arange(len(simplices))
    mates, crowded = _kernels.match_facets(simplices, n)
    if crowded >= 0:
        _, first = np.unique(np.sort(simplices, axis=1), axis=0, return_index=True)
        source = np.sort(first)
        simplices = np.ascontiguousarray(simplices[source])
        mates, crowded = _kernels.match_facets(simplices, n)
    if crowded >= 0:
        facet = np.delete(simplices[crowded // (d + 1)], crowded % (d + 1)).tolist()
        raise InvalidMeshError(f"more than two {CELL_NAMES[d][1]} share the {FACET_NAMES[d]} {facet}: they overlap")
    component, against, orientable = _kernels.orient(simplices, mates)
    if not orientable:
        raise InvalidMeshError(f"the {CELL_NAMES[d][1]} form a Moebius band: no numbering makes all of them positive")
    flipped = against.astype(bool)
    # The signed size of a consistently numbered component depends on its boundary alone, so it tells a mesh that
    # is numbered the other way round from one whose interior is tangled.
    measure = _kernels.measure(points, simplices, 1)[0] * np.where(flipped, -1.0, 1.0)
    flipped ^= (np.bincount(component, weights=measure) < 0)[component]
    if flipped.any():
        simplices = np.where(flipped[:, None], _swapped(simplices), simplices)
        mates, _ = _kernels.match_facets(simplices, n)
    return Topology(simplices, n, source, flipped, component, mates)


def _swapped(rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """Swap the first two columns: the other orientation."""
    return np.concatenate([rows[:, 1::-1], rows[:, 2:]], axis=1)
