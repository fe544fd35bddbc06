"""A simplicial mesh as a value: what moves (`Mesh.points`) and what does not (`Topology`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
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
MEASURE_NAMES = {2: "area", 3: "volume"}
ANGLE_NAMES = {2: "angle", 3: "dihedral angle"}


@dataclass(frozen=True, eq=False)
class Topology:
    """Connectivity, computed once and shared by every position of the points.

    Attributes
    ----------
    n : int
        Number of points.
    source : (m,) int64
        The row of the user's array behind each simplex (repeated simplices are left out).
    flipped : (m,) bool
        True where the user's numbering has the other orientation.
    connectivity : _kernels.Connectivity
        The same in the order in which the kernels work, which is near in memory where it is near in space:
        `vertices` (k,) and `rows` (m,) are the numbers that its vertices and simplices have here.
    """

    n: int
    source: NDArray[np.int64]
    flipped: NDArray[np.bool_]
    connectivity: _kernels.Connectivity

    @property
    def m(self) -> int:
        """Number of simplices."""
        return len(self.source)

    @property
    def dimension(self) -> int:
        """2 for triangles, 3 for tetrahedra."""
        return self.connectivity.simplices.shape[1] - 1

    def stars(self, threads: int = 1) -> _kernels.Connectivity:
        """Return the connectivity with neighbours, faces and colours of blocks, made when they are first needed."""
        try:
            self.connectivity.build_stars(threads)
        except ValueError as error:  # a star, or the mesh, is too large to be numbered
            raise InvalidMeshError(str(error)) from error
        return self.connectivity

    @cached_property
    def colours(self) -> list[NDArray[np.int32]]:
        """The blocks of each colour; no two blocks of one colour share an edge."""
        stars = self.stars()
        return np.split(stars.colour_blocks, stars.colour_offsets[1:-1])

    @cached_property
    def simplices(self) -> NDArray[np.int32]:
        """(m, d+1) int32: the vertices of each simplex, positively oriented."""
        mesh = self.connectivity
        return _read_only(self.of_rows(mesh.vertices[mesh.simplices]))

    @cached_property
    def component(self) -> NDArray[np.int32]:
        """(m,) int32: simplices joined through facets have the same number."""
        return _read_only(self.of_rows(self.connectivity.component))

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """(n,) bool: the vertices of simplices; other points are isolated."""
        mask = np.zeros(self.n, dtype=bool)
        mask[self.connectivity.vertices] = True
        return mask

    @cached_property
    def number(self) -> NDArray[np.int32]:
        """(n,) int32: the number of each vertex in the connectivity; 0 for isolated points."""
        numbers = np.zeros(self.n, dtype=np.int32)
        numbers[self.connectivity.vertices] = np.arange(len(self.connectivity.vertices), dtype=np.int32)
        return numbers

    @cached_property
    def boundary(self) -> NDArray[np.bool_]:
        """(n,) bool: vertices of facets that belong to one simplex."""
        return self._mark_facets(self.connectivity.mates < 0)

    @cached_property
    def mirrored(self) -> NDArray[np.bool_]:
        """(m,) bool: simplices of components whose numbering has, for most, the other orientation.

        Components without an inner vertex have that of the whole mesh.
        """
        if not self.flipped.any():
            return np.zeros(len(self.flipped), dtype=bool)
        votes = np.bincount(self.component, weights=self.flipped * 2.0 - 1.0)
        inner = (self.used & ~self.boundary)[self.simplices].any(axis=1)
        # Without an inner vertex a part is its boundary: that may be tangled as well as mirrored, so all parts vote.
        by_itself = np.bincount(self.component, weights=inner) > 0
        return np.where(by_itself, votes > 0, votes.sum() > 0)[self.component]

    @cached_property
    def misnumbered(self) -> NDArray[np.bool_]:
        """(m,) bool: simplices numbered against most of their component: inverted for whoever reads the file."""
        return self.flipped != self.mirrored

    def interface(self, regions: ArrayLike) -> NDArray[np.bool_]:
        """(n,) bool: vertices of facets between simplices of different regions; `regions` (m,) labels."""
        mesh = self.connectivity
        labels = np.asarray(regions)[mesh.rows]
        across = labels[mesh.mates // (self.dimension + 1)]
        return self._mark_facets((mesh.mates >= 0) & (across != labels[:, None]))

    def grown(self, vertices: NDArray[np.bool_], rings: int) -> NDArray[np.bool_]:
        """(n,) bool: these vertices and `rings` rings of neighbours around them."""
        return vertices | self.of_vertices(
            self.connectivity.grown(vertices[self.connectivity.vertices], rings).view(bool)
        )

    def of_vertices(self, values: NDArray[_T]) -> NDArray[_T]:
        """Return values (k, ...) of the connectivity's vertices as those of all points (n, ...); 0: isolated."""
        result = np.take(values, self.number, axis=0)
        if len(values) < self.n:
            result[~self.used] = 0
        return result

    def of_rows(self, values: NDArray[_T]) -> NDArray[_T]:
        """Return values (m, ...) of the connectivity's simplices in the order of the simplices."""
        result = np.empty_like(values)
        result[self.connectivity.rows] = values
        return result

    def _mark_facets(self, facets: NDArray[np.bool_]) -> NDArray[np.bool_]:
        mesh, corners = self.connectivity, self.dimension + 1
        mask = np.zeros(len(mesh.vertices), dtype=bool)
        for position in range(corners):
            rows = np.flatnonzero(facets[:, position])
            for other in range(corners):
                if other != position:
                    mask[mesh.simplices[rows, other]] = True
        return self.of_vertices(mask)


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
    def build(cls, points: ArrayLike, simplices: ArrayLike, fixed: ArrayLike | None = None, threads: int = 1) -> Mesh:
        """Check the arrays, orient the simplices and fix the boundary.

        Parameters
        ----------
        points : (n, d) float
            d = 2 for triangles, 3 for tetrahedra.
        simplices : (m, d+1) int
            Numbered either way round; see `Topology.flipped`.
        fixed : (n,) bool, optional
            Vertices that must not move, beside those of the boundary.
        threads : int

        Raises
        ------
        InvalidMeshError
            Wrong shapes, no simplices, indices out of range, coordinates that are not finite or too large,
            a simplex that names a vertex twice, a facet of more than two simplices, a Moebius band.
        """
        p = np.array(points, dtype=np.float64, order="C")
        rows = _checked_simplices(p, np.asarray(simplices), threads)
        used = _kernels.used_vertices(rows, len(p))
        _check_coordinates(p, used)
        topology = _build_topology(p, rows, used, threads)
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
        return replace(self, points=_read_only(np.ascontiguousarray(points)))

    def with_vertices(self, positions: NDArray[np.float64]) -> Mesh:
        """Return the same mesh with other positions (k, d) of the connectivity's vertices."""
        points = self.topology.of_vertices(positions)
        if len(positions) < len(points):  # isolated ones stay
            points = np.where(self.topology.used[:, None], points, self.points)
        return self.with_points(points)

    def with_fixed(self, fixed: NDArray[np.bool_]) -> Mesh:
        """Return the same mesh with more vertices fixed, `fixed` (n,) bool."""
        return replace(self, movable=_read_only(self.movable & ~fixed))

    def along_curve(self, values: NDArray[_T]) -> NDArray[_T]:
        """Return values (n, ...) of the points as those (k, ...) of the connectivity's vertices."""
        return np.take(values, self.topology.connectivity.vertices, axis=0)

    def check(self, threads: int = 1) -> tuple[int, float]:
        """Return the number of inverted simplices and the smallest signed area or volume, in model units."""
        points, simplices = self.along_curve(self.points), self.topology.connectivity.simplices
        inverted, smallest = _kernels.check(points, simplices, threads)
        return len(inverted), smallest

    def stuck(self, threads: int = 1) -> NDArray[np.int32]:
        """Return the rows of the connectivity's simplices that have no free vertex."""
        return self.topology.connectivity.stuck(self.along_curve(self.movable), threads)

    def mean_edge_length(self, threads: int = 1) -> float:
        """Return h of the paper's section 4: the mean length of the distinct edges, in model units."""
        stars, points = self.topology.stars(threads), self.along_curve(self.points)
        start = np.repeat(np.arange(len(points), dtype=np.int32), np.diff(stars.neighbour_offsets))
        once = start < stars.neighbours
        edges = points[stars.neighbours[once]] - points[start[once]]
        return float(np.linalg.norm(edges, axis=1).mean())


def _read_only(array: NDArray[_T]) -> NDArray[_T]:
    array.flags.writeable = False
    return array


def _checked_simplices(
    points: NDArray[np.float64], simplices: NDArray[np.integer[Any]], threads: int
) -> NDArray[np.int32]:
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
    # What does not fit in 32 bits is outside as well.
    small = simplices if simplices.dtype.itemsize <= 4 else np.clip(simplices, -1, n)
    rows = np.ascontiguousarray(small, dtype=np.int32)
    outside, repeated = _kernels.check_simplices(rows, n, threads)
    if outside >= 0:
        named = simplices[outside].tolist()
        raise InvalidMeshError(f"element {outside} refers to vertices {named}, but there are {n} points")
    if repeated >= 0:
        raise InvalidMeshError(f"element {repeated} names a vertex twice: {simplices[repeated].tolist()}")
    return rows


def _check_coordinates(points: NDArray[np.float64], used: NDArray[np.int32]) -> None:
    corners = np.take(points, used, axis=0)
    finite = np.isfinite(corners)
    if not finite.all():
        vertex = int(used[np.argmin(finite.all(axis=1))])
        raise InvalidMeshError(f"vertex {vertex} has a coordinate that is not finite")
    low, high = corners.min(axis=0), corners.max(axis=0)
    if max(-low.min(), high.max()) > LARGEST_COORDINATE:
        raise InvalidMeshError(f"coordinates beyond {LARGEST_COORDINATE:g} cannot be computed with")
    if (high - low).max() < SMALLEST_SIZE:
        raise InvalidMeshError("all vertices are in one point")


def _build_topology(
    points: NDArray[np.float64], simplices: NDArray[np.int32], used: NDArray[np.int32], threads: int
) -> Topology:
    n, d = points.shape
    source = np.arange(len(simplices))
    mesh = _kernels.Connectivity(points, simplices, used, threads)
    if mesh.crowded >= 0:
        _, first = np.unique(np.sort(simplices, axis=1), axis=0, return_index=True)
        source = np.sort(first)
        mesh = _kernels.Connectivity(points, np.ascontiguousarray(simplices[source]), used, threads)
    if mesh.crowded >= 0:
        row, position = divmod(mesh.crowded, d + 1)
        facet = np.delete(mesh.vertices[mesh.simplices[row]], position).tolist()
        raise InvalidMeshError(f"more than two {CELL_NAMES[d][1]} share the {FACET_NAMES[d]} {facet}: they overlap")
    if not mesh.orientable:
        raise InvalidMeshError(f"the {CELL_NAMES[d][1]} form a Moebius band: no numbering makes all of them positive")
    flipped = mesh.against.astype(bool)
    # The signed size of a consistently numbered component depends on its boundary alone, so it tells a mesh that
    # is numbered the other way round from one whose interior is tangled.
    measure = _kernels.measure(np.take(points, mesh.vertices, axis=0), mesh.simplices, threads)[0]
    np.negative(measure, out=measure, where=flipped)
    flipped ^= (np.bincount(mesh.component, weights=measure) < 0)[mesh.component]
    if flipped.any():
        mesh.flip(flipped, threads)
    rows = np.empty_like(flipped)
    rows[mesh.rows] = flipped
    return Topology(n, source, rows, mesh)
