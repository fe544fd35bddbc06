"""Connectivity: what does not move."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import SIMPLICES, Element, Shape, counted

_T = TypeVar("_T", bound=np.generic)


# By the position of a corner, those of the facet opposite it, in positive order seen from outside.
_OPPOSITE = {d: np.array(element.shape.facets) for d, element in SIMPLICES.items()}


@dataclass(frozen=True, eq=False)
class Block:
    """The elements of one type.

    Attributes
    ----------
    element : Element
    rows : (k,) int32
        Which of the mesh's elements they are, ascending.
    vertices : (k, nodes) int32
        Their vertices, positively oriented.
    """

    element: Element
    rows: NDArray[np.int32]
    vertices: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Topology:
    """Connectivity, computed once and shared by every position of the points.

    Arrays of points (n, ...) and of simplices (m, ...) have the user's order, those of `connectivity` that of the
    kernels; `of_vertices`, `of_rows` and `Mesh.along_curve` lead from one to the other.

    Attributes
    ----------
    n : int
        Number of points.
    source : (m,) int32
        The row of the user's array behind each simplex (repeated simplices are left out).
    flipped : (m,) bool
        True where the user's numbering has the other orientation.
    connectivity : kernels.Connectivity
        The same in the order in which the kernels work, which is near in memory where it is near in space. Its arrays,
        all int32 and read-only:

        - `vertices` (k,), `rows` (m,): the numbers that its vertices and simplices have here; all others are its own.
        - `simplices` (m, d+1): positively oriented. A corner is the number simplex * (d+1) + position, and also names
          the facet opposite it.
        - `mates` (m, d+1): the corner on the other side of each facet, -1 on the boundary.
        - `component` (m,): simplices that are joined through facets have the same number.
        - `offsets` (k+1,), `corners`: the corners at each vertex, one vertex behind the other.
        - `neighbour_offsets` (k+1,), `neighbours`: the vertices that share an edge with each.
        - `colour_offsets`, `colour_blocks`: blocks of a colour share no edge; block b has the vertices from
          b * `kernels.BLOCK_SIZE` on.

        The last two lines are empty until `stars` has been called.
    """

    n: int
    source: NDArray[np.int32]
    flipped: NDArray[np.bool_]
    connectivity: kernels.Connectivity

    @property
    def m(self) -> int:
        """Number of simplices."""
        return len(self.source)

    @property
    def dimension(self) -> int:
        """2 for triangles, 3 for tetrahedra."""
        return self.connectivity.simplices.shape[1] - 1

    @property
    def simplicial(self) -> bool:
        """Whether all elements are simplices of one type."""
        return self.connectivity.simplicial

    @property
    def element(self) -> Element:
        """The type of the simplices."""
        return SIMPLICES[self.dimension]

    def edges(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the two ends (e,) of each edge, once, in the numbers of the connectivity."""
        stars = self.stars()
        start = np.repeat(np.arange(len(stars.vertices), dtype=np.int32), np.diff(stars.neighbour_offsets))
        once = start < stars.neighbours
        return start[once], stars.neighbours[once]

    def stars(self, threads: int = 1) -> kernels.Connectivity:
        """Return the connectivity with neighbours, faces and colours of blocks, made when they are first needed.

        Raises
        ------
        InvalidMeshError
            A vertex has more than 65,535 neighbours, or the mesh more corners than 32 bits can number.
        """
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
        return read_only(self.of_rows(mesh.vertices[mesh.simplices]))

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The elements by their types."""
        return (Block(self.element, read_only(np.arange(self.m, dtype=np.int32)), self.simplices),)

    @cached_property
    def component(self) -> NDArray[np.int32]:
        """(m,) int32: simplices joined through facets have the same number."""
        return read_only(self.of_rows(self.connectivity.component))

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """(n,) bool: the vertices of simplices; other points are isolated."""
        mask = np.zeros(self.n, dtype=bool)
        mask[self.connectivity.vertices] = True
        return mask

    @cached_property
    def positions(self) -> NDArray[np.int32]:
        """(m,) int32: where each simplex stands in the connectivity."""
        return self.of_rows(np.arange(self.m, dtype=np.int32))

    @cached_property
    def number(self) -> NDArray[np.int32]:
        """(n,) int32: the number of each vertex in the connectivity; 0 for isolated points."""
        numbers = np.zeros(self.n, dtype=np.int32)
        numbers[self.connectivity.vertices] = np.arange(len(self.connectivity.vertices), dtype=np.int32)
        return numbers

    @cached_property
    def boundary(self) -> NDArray[np.bool_]:
        """(n,) bool: vertices of facets that belong to one simplex."""
        return self.of_vertices(self.connectivity.boundary().view(bool))

    @cached_property
    def inner(self) -> NDArray[np.bool_]:
        """(m,) bool: simplices with a vertex that is not on the boundary."""
        off = self.used & ~self.boundary
        return np.asarray(off[self.simplices].any(axis=1))

    def across(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the element (f,) of each facet, by its row in the connectivity, and that across; -1: there is none."""
        mesh, corners = self.connectivity, self.dimension + 1
        if mesh.simplicial:
            return np.repeat(np.arange(self.m, dtype=np.int32), corners), mesh.mates.ravel() // corners
        return mesh.facet_owners, np.where(mesh.facet_mates < 0, -1, mesh.facet_owners[mesh.facet_mates])

    @cached_property
    def joined(self) -> NDArray[np.int32]:
        """(p, 2) int32: the elements, by their rows in the connectivity, that have a facet in common."""
        here, there = self.across()
        once = np.flatnonzero(there > here)
        pairs = np.empty((len(once), 2), dtype=np.int32)
        pairs[:, 0], pairs[:, 1] = here[once], there[once]
        return read_only(pairs)

    @cached_property
    def mirrored(self) -> NDArray[np.bool_]:
        """(m,) bool: simplices of components whose numbering has, for most, the other orientation.

        Components without an inner vertex have that of the whole mesh.
        """
        if not self.flipped.any():
            return np.zeros(len(self.flipped), dtype=bool)
        votes = np.bincount(self.component, weights=self.flipped * 2.0 - 1.0)
        # Without an inner vertex a part is its boundary: that may be tangled as well as mirrored, so all parts vote.
        by_itself = np.bincount(self.component, weights=self.inner) > 0
        return np.where(by_itself, votes > 0, votes.sum() > 0)[self.component]

    @cached_property
    def misnumbered(self) -> NDArray[np.bool_]:
        """(m,) bool: simplices numbered against most of their component: inverted for whoever reads the file."""
        return self.flipped != self.mirrored

    def interface(self, regions: ArrayLike) -> NDArray[np.bool_]:
        """Mark the vertices of facets between simplices of different regions.

        Parameters
        ----------
        regions : (m,) array
            Labels of any kind that can be compared.

        Returns
        -------
        (n,) bool
        """
        mesh = self.connectivity
        labels = np.asarray(regions)[mesh.rows]
        across = labels[mesh.mates // (self.dimension + 1)]
        return self._mark_facets((mesh.mates >= 0) & (across != labels[:, None]))

    def grown(self, vertices: NDArray[np.bool_], rings: int) -> NDArray[np.bool_]:
        """Mark vertices and rings of neighbours around them.

        Parameters
        ----------
        vertices : (n,) bool
        rings : int
            0: these vertices alone.

        Returns
        -------
        (n,) bool
        """
        return vertices | self.of_vertices(self.stars().grown(vertices[self.connectivity.vertices], rings).view(bool))

    def owners(self, simplices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the elements of corner simplices, both by their numbers in the connectivity."""
        return simplices

    def centroids(self, points: NDArray[np.float64], rows: NDArray[np.integer]) -> NDArray[np.float64]:
        """Return the mean of the vertices (r, d) of some elements, all in the order of the connectivity."""
        return np.asarray(points[self.connectivity.simplices[rows]].mean(axis=1))

    def of_vertices(self, values: NDArray[_T]) -> NDArray[_T]:
        """Return values (k, ...) of the connectivity's vertices as those of all points (n, ...); 0: isolated."""
        result = rows_of(values, self.number)
        if len(values) < self.n:
            result[~self.used] = 0
        return result

    def of_rows(self, values: NDArray[_T]) -> NDArray[_T]:
        """Return values (m, ...) of the connectivity's simplices in the order of the simplices."""
        result = np.empty_like(values)
        result[self.connectivity.rows] = values
        return result

    def facets_between(
        self, regions: NDArray[np.integer] | None
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        """Return the facets (f, w) of the boundary and, if there are any, between regions (m,), each once.

        With the element (f,) that each is of, and the one across, -1: none. All in the numbers of the connectivity,
        from outside of that element, which has the lower region; -1: no more vertices.
        """
        mesh, corners = self.connectivity, self.dimension + 1
        chosen = mesh.mates < 0
        if regions is not None:
            label = np.asarray(regions)[mesh.rows]
            chosen |= label[mesh.mates // corners] > label[:, None]
        row, position = np.divmod(np.flatnonzero(chosen), corners)
        across = mesh.mates[row, position] // corners
        return mesh.simplices[row[:, None], _OPPOSITE[self.dimension][position]], row.astype(np.int32), across

    def _mark_facets(self, facets: NDArray[np.bool_]) -> NDArray[np.bool_]:
        mesh, corners = self.connectivity, self.dimension + 1
        mask = np.zeros(len(mesh.vertices), dtype=bool)
        for position in range(corners):
            rows = np.flatnonzero(facets[:, position])
            for other in range(corners):
                if other != position:
                    mask[mesh.simplices[rows, other]] = True
        return self.of_vertices(mask)


def rows_of(values: NDArray[_T], which: NDArray[np.int32]) -> NDArray[_T]:
    """Return rows (k, ...) of values (n, ...)."""
    if values.dtype == np.float64 and values.ndim == 2 and values.flags.c_contiguous and values.shape[1] in (2, 3):
        return kernels.rows(values, which)  # type: ignore[return-value, arg-type]
    return np.take(values, which, axis=0)


def rows_of_part(
    offsets: NDArray[np.int32], vertices: NDArray[np.int32], own: int
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the offsets of compressed rows of some vertices (v,), empty but for the first `own`, and what is there."""
    counts = np.diff(offsets)[vertices]
    counts[own:] = 0
    begins = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return begins, np.arange(begins[-1]) + np.repeat(offsets[vertices] - begins[:-1], counts)


def distinct(values: NDArray[_T]) -> NDArray[_T]:
    """Return the different values (k,), ascending: numpy's `unique` imports what takes a twentieth of a small run."""
    ordered = np.sort(values, axis=None)
    is_new = np.ones(len(ordered), dtype=bool)
    is_new[1:] = ordered[1:] != ordered[:-1]
    return ordered[is_new]


def read_only(array: NDArray[_T]) -> NDArray[_T]:
    """Return the array, which cannot be written to any more."""
    array.flags.writeable = False
    return array


def refers_outside(what: str, vertices: NDArray[np.integer], n: int) -> InvalidMeshError:
    """Return the complaint about an element, by what it is called, of vertices that are not among the n points."""
    there = f"there {'is' if n == 1 else 'are'} {counted(n, 'point', 'points')}"
    return InvalidMeshError(f"{what} refers to vertices {vertices.tolist()}, but {there}")


def names_twice(row: int, vertices: NDArray[np.integer]) -> InvalidMeshError:
    """Return the complaint about an element that has a vertex twice."""
    return InvalidMeshError(f"element {row} names a vertex twice: {vertices.tolist()}")


def crowded_facet(shape: Shape, facet: list[int]) -> InvalidMeshError:
    """Return the complaint about a facet of more than two elements."""
    return InvalidMeshError(f"more than two {shape.plural} share the {shape.facet} {facet}: they overlap")


def moebius(shape: Shape) -> InvalidMeshError:
    """Return the complaint about elements that have no common orientation."""
    return InvalidMeshError(f"the {shape.plural} form a Moebius band: no numbering makes all of them positive")


def turned_over(mesh: kernels.Connectivity, points: NDArray[np.float64], shape: Shape) -> NDArray[np.bool_]:
    """Mark the elements (m,), in the order of the connectivity, that are numbered the other way round.

    In a surface: than most of those that it is joined with; where these have no common orientation, than most of those
    that are numbered as one of them.

    Raises
    ------
    InvalidMeshError
        A Moebius band that is no surface in space.
    """
    against = mesh.against.astype(bool)
    if points.shape[1] > shape.dimension:
        votes = np.bincount(mesh.component, weights=against * 2.0 - 1.0)
        return np.asarray(against ^ (votes > 0)[mesh.component])
    if not mesh.orientable:
        raise moebius(shape)
    return against ^ (mesh.signed_sizes(points) < 0)[mesh.component]


def build_topology(
    points: NDArray[np.float64], simplices: NDArray[np.int32], used: NDArray[np.int32], threads: int
) -> Topology:
    """Orient simplices, leave out repetitions and find what is joined.

    Parameters
    ----------
    points : (n, d) float64, or (n, 3) of triangles of a surface
    simplices : (m, d+1) int32
        Checked: numbers of points, none twice in a simplex.
    used : (k,) int32
        The vertices of simplices, ascending.
    threads : int

    Raises
    ------
    InvalidMeshError
        Unless it is a surface: a facet of more than two simplices, a Moebius band.
    """
    n, d = len(points), simplices.shape[1] - 1
    shape = SIMPLICES[d].shape
    source = np.arange(len(simplices), dtype=np.int32)
    mesh = kernels.Connectivity(points, simplices, used, threads)
    if mesh.crowded >= 0:
        _, first = np.unique(np.sort(simplices, axis=1), axis=0, return_index=True)
        source = np.sort(first).astype(np.int32)
        mesh = kernels.Connectivity(points, np.ascontiguousarray(simplices[source]), used, threads)
    if mesh.crowded >= 0:
        row, position = divmod(mesh.crowded, d + 1)
        raise crowded_facet(shape, np.delete(mesh.vertices[mesh.simplices[row]], position).tolist())
    flipped = turned_over(mesh, points, shape)
    rows = np.zeros_like(flipped)
    if flipped.any():
        mesh.flip(flipped, threads)
        rows[mesh.rows] = flipped & mesh.orientable
    return Topology(n, source, rows, mesh)
