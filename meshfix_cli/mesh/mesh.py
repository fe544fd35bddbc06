"""A mesh as a value: points, their topology, and which of them may move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import JUDGED, SIMPLICES, counted, words
from meshfix_cli.mesh.judged import VALID, Judged, Unfolded
from meshfix_cli.mesh.mixed import MixedTopology, build_mixed, checked_blocks
from meshfix_cli.mesh.topology import Topology, build_topology, names_twice, read_only, refers_outside, rows_of

if TYPE_CHECKING:
    from meshfix_cli.mesh.freedom import Freedom
    from meshfix_cli.mesh.quadratic import Judgement, Quadratic
    from meshfix_cli.mesh.sides import Surface

_T = TypeVar("_T", bound=np.generic)

# Squares and sixth powers of lengths must neither overflow nor vanish in double precision.
LARGEST_COORDINATE = 1e45
SMALLEST_SIZE = 1e-45
# Why a vertex is fixed, where nobody asked for it; of interfaces the name of the regions follows.
ON_BOUNDARY, BETWEEN = "on the boundary", "between regions of"


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Points and their topology; immutable, a moved mesh is a new one.

    Attributes
    ----------
    points : (n, d) float64
        Positions in model units, read-only.
    topology : Topology
    movable : (n,) bool
        The free vertices.
    apart : bool
        Separate parts have coordinates of their own: that they overlap means nothing.
    freedom : Freedom or None
        Where those of the movable vertices may go that are on the boundary; None: there are none.
    quadratic : Quadratic or None
        The elements of higher order of which some are curved; None: each element is the straight one of its corners.
    surface : Surface or None
        What tells the sides of a surface in space, of which the points are (n, 3) and the elements of dimension 2.
    """

    points: NDArray[np.float64]
    topology: Topology
    movable: NDArray[np.bool_]
    apart: bool = False
    freedom: Freedom | None = None
    quadratic: Quadratic | None = None
    surface: Surface | None = None

    @classmethod
    def build(
        cls,
        points: ArrayLike,
        cells: ArrayLike | Sequence[tuple[str, ArrayLike]] | Mapping[str, ArrayLike],
        fixed: ArrayLike | None = None,
        threads: int = 1,
    ) -> Mesh:
        """Check the arrays, orient the elements and fix the boundary.

        Parameters
        ----------
        points : (n, d) float
            d = 2 for triangles and quadrilaterals, 3 for solids and for surfaces of these.
        cells : (m, d+1) int, or sequence or dict of (str, (k, nodes) int)
            Simplices, or elements by their types, such as ("hexahedron", ...), which are numbered in this order.
            Numbered either way round; see `Topology.flipped`.
        fixed : (n,) bool or (k,) int, optional
            Vertices that must not move, beside those of the boundary: a mask, or their indices.
        threads : int

        Raises
        ------
        InvalidMeshError
            Wrong shapes, no elements, indices out of range, coordinates that are not finite or too large,
            an element that names a vertex twice; but for surfaces, a facet of more than two elements, a Moebius band;
            `fixed` is neither a mask nor indices.
        """
        p = np.array(regular(points, "the points are"), dtype=np.float64, order="C")
        blocks = _blocks_of(cells)
        topology: Topology
        if isinstance(blocks, np.ndarray):
            rows = _checked_simplices(p, blocks, threads)
            used = kernels.used_vertices(rows, len(p))
            check_coordinates(p, used)
            topology = build_topology(p, rows, used, threads)
        else:
            _check_shape(p)
            checked = checked_blocks(blocks, *p.shape)
            used = kernels.used_vertices(np.concatenate([rows.reshape(-1, 1) for _, rows in checked]), len(p))
            check_coordinates(p, used)
            topology = build_mixed(p, checked, used, threads)
        movable = topology.used & ~topology.boundary
        if fixed is not None:
            movable &= ~mask_of(fixed, len(p))
        mesh = cls(read_only(p), topology, read_only(movable))
        if p.shape[1] == topology.dimension:
            return mesh
        from meshfix_cli.mesh.sides import Surface, normals_seen

        normals = normals_seen(topology, mesh.along_curve(mesh.points), threads)
        return replace(mesh, surface=Surface(read_only(normals)))

    def __repr__(self) -> str:
        counts = [counted(len(block.rows), *words(block.element.key)) for block in self.topology.blocks]
        free, used = int(self.movable.sum()), counted(int(self.topology.used.sum()), "vertex", "vertices")
        return f"<{type(self).__name__}: {', '.join([*counts, used])}: {free:,} free>"

    @property
    def dimension(self) -> int:
        """That of the elements, 2 or 3."""
        return self.topology.dimension

    def with_points(self, points: NDArray[np.float64]) -> Mesh:
        """Return the same mesh with other positions.

        Parameters
        ----------
        points : (n, d) float64
            In model units; the array itself is kept where it is contiguous, and becomes read-only.

        Raises
        ------
        ValueError
            The array has another shape or type. Whether the coordinates are finite is not looked at.
        """
        if points.shape != self.points.shape or points.dtype != np.float64:
            raise ValueError(f"points have the shape {points.shape}, and this mesh {self.points.shape}")
        return replace(self, points=read_only(np.ascontiguousarray(points)))

    def with_vertices(self, positions: NDArray[np.float64]) -> Mesh:
        """Return the same mesh with other positions (k, d) of the connectivity's vertices."""
        points = self.topology.of_vertices(positions)
        if len(positions) < len(points):  # isolated ones stay
            points = np.where(self.topology.used[:, None], points, self.points)
        return self.with_points(points)

    def with_fixed(self, fixed: NDArray[np.bool_]) -> Mesh:
        """Return the same mesh with more vertices fixed, `fixed` (n,) bool."""
        return replace(self, movable=read_only(self.movable & ~fixed))

    def sliding(self, freedom: Freedom, held: NDArray[np.bool_]) -> Mesh:
        """Return the same mesh where the vertices that a freedom has lines and planes for move in these.

        Those `held` (n,) bool do not.
        """
        slides = self.topology.of_vertices(freedom.frame >= 0)
        return replace(self, freedom=freedom, movable=read_only(self.movable | (slides & ~held)))

    @property
    def anywhere(self) -> NDArray[np.bool_]:
        """(n,) bool: the movable vertices that may go anywhere."""
        if self.freedom is None:
            return self.movable
        return self.movable & ~self.topology.of_vertices(self.freedom.frame >= 0)

    @property
    def used(self) -> NDArray[np.bool_]:
        """(n,) bool: the vertices of elements, and of curved ones all nodes: what is moved by itself."""
        used = self.topology.used
        return used if self.quadratic is None else used | self.quadratic.used

    @property
    def held(self) -> Mesh:
        """The same mesh, in which nothing slides."""
        return replace(self, movable=read_only(self.anywhere), freedom=None)

    def along_curve(self, values: NDArray[_T]) -> NDArray[_T]:
        """Return values (n, ...) of the points as those (k, ...) of the connectivity's vertices."""
        return rows_of(values, self.topology.connectivity.vertices)

    def check(self, threads: int = 1) -> tuple[int, float]:
        """Count the inverted elements: those whose determinant is not positive everywhere, beyond rounding.

        Returns
        -------
        inverted : int
        smallest : float
            The smallest signed area or volume of all corner simplices, or of all curved elements, in model units.
        """
        if self.quadratic is not None:
            wrong, smallest, _ = self.judge_curved(threads)
            return int(wrong.sum()), smallest
        inverted, smallest = self.judged().check(self.along_curve(self.points), threads)
        return len(inverted), smallest

    def judged(self, rows: NDArray[np.integer] | None = None) -> Judged:
        """Return some elements, by their rows (k,) in the order of the connectivity, or all, to be judged."""
        return Judged(self.topology.connectivity, rows, None if self.surface is None else self.surface.normals)

    def unfolded(self, threads: int = 1) -> Mesh:
        """Return the elements of a surface one by one in their planes, each with nodes of its own; see `Unfolded`."""
        assert self.surface is not None
        topology, blocks = self.topology, self.topology.blocks
        normals = topology.of_rows(self.surface.normals)
        counts = np.zeros(topology.m, dtype=np.int32)
        codes = np.zeros(topology.m, dtype=np.uint8)
        for block in blocks:
            counts[block.rows] = block.vertices.shape[1]
            codes[block.rows] = JUDGED.index(block.element)
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        nodes = np.empty(offsets[-1], dtype=np.int32)
        for block in blocks:
            nodes[offsets[block.rows][:, None] + np.arange(block.vertices.shape[1])] = block.vertices
        apart = Unfolded(nodes, offsets, normals, None if topology.simplicial else codes)
        kind = Topology if topology.simplicial else MixedTopology
        source, flipped = np.arange(topology.m, dtype=np.int32), np.zeros(topology.m, dtype=bool)
        flat = kind(len(nodes), source, flipped, apart.connectivity)
        return Mesh(read_only(apart.points(self.points, threads)), flat, read_only(np.zeros(len(nodes), dtype=bool)))

    def judge_curved(self, threads: int = 1) -> tuple[NDArray[np.bool_], float, Judgement]:
        """Judge a mesh with `quadratic` elements, and the others as straight ones.

        Returns
        -------
        wrong : (m,) bool
            The inverted elements.
        smallest : float
            See `check`.
        judgement : Judgement
            Of the quadratic elements.
        """
        quadratic, topology = self.quadratic, self.topology
        assert quadratic is not None
        judgement = quadratic.judge(self.points, threads)
        wrong, smallest = np.zeros(topology.m, dtype=bool), float(judgement.measures.min())
        wrong[quadratic.rows] = judgement.verdicts != VALID
        others = np.delete(topology.positions, quadratic.rows)
        if len(others):
            inverted, least = self.judged(others).check(self.along_curve(self.points), threads)
            wrong[topology.connectivity.rows[others[inverted]]] = True
            smallest = min(smallest, least)
        return wrong, smallest, judgement

    def stuck(self, threads: int = 1) -> NDArray[np.int32]:
        """Return the rows (k,), in the order of the connectivity, of the elements that have no free vertex."""
        return self.topology.connectivity.stuck(self.along_curve(self.movable), threads)

    def mean_edge_length(self, threads: int = 1) -> float:
        """Return h of the paper's section 4: the mean length of the distinct edges, in model units."""
        points, stars = self.along_curve(self.points), self.topology.stars(threads)
        if self.topology.simplicial:
            return float(kernels.edge_lengths(points, stars).mean())
        start, end = self.topology.edges()
        return float(np.linalg.norm(points[end] - points[start], axis=1).mean())

    def boundary_edge_length(self) -> float:
        """Return the mean length of the sides of the boundary's facets, in model units: no tangle inside changes it.

        Of a surface it is that of all edges.
        """
        if self.surface is not None:
            return self.mean_edge_length()
        points, facets = self.along_curve(self.points), self.topology.facets_between(None)[0]
        following = np.roll(facets, -1, axis=1)
        following = np.where(following < 0, facets[:, :1], following)
        start, end = facets[facets >= 0], following[facets >= 0]
        return float(np.linalg.norm(points[end] - points[start], axis=1).mean())


def regular(values: ArrayLike, what: str) -> NDArray[Any]:
    """Return an array of numbers; InvalidMeshError for rows of several lengths, texts and the like."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InvalidMeshError(f"{what} rows of several lengths, which are no array") from error
    if array.dtype.kind not in "biuf":
        raise InvalidMeshError(f"{what} no array of numbers")
    return array


def mask_of(fixed: ArrayLike, n: int) -> NDArray[np.bool_]:
    """Return the mask (n,) of some vertices, which a mask or their indices tell.

    Raises
    ------
    InvalidMeshError
        It is neither; numbers that are 0 or 1, one for each vertex, could be both.
    """
    given = regular(fixed, "fixed is")
    given = given[0] if isinstance(fixed, tuple) and given.shape[:1] == (1,) and given.ndim == 2 else given  # np.where
    mask = np.zeros(n, dtype=bool)
    if given.size == 0:  # of an empty list numpy makes numbers with a point
        return mask
    if given.dtype == bool and given.shape == mask.shape:
        return given.copy()  # whoever has given it may change it
    if given.ndim != 1 or given.dtype.kind not in "iu":
        what = f"an array of shape {given.shape} and type {given.dtype}"
        raise InvalidMeshError(f"fixed is {what}, and neither a mask ({n},) of bool nor indices of vertices")
    if len(given) == n > 2 and given.max() <= 1:
        raise InvalidMeshError("fixed has a 0 or a 1 for each vertex: as a mask it is to be of bool")
    outside = given[(given < 0) | (given >= n)]
    if len(outside):
        raise InvalidMeshError(f"fixed names vertex {outside[0]}, and there are those from 0 to {n - 1}")
    mask[given] = True
    return mask


def _blocks_of(cells: Any) -> NDArray[Any] | list[tuple[str, Any]]:
    """Return an array of simplices, or several types of elements."""
    if isinstance(cells, Mapping):
        cells = list(cells.items())
    if not (isinstance(cells, Sequence) and cells and isinstance(cells[0][0], str)):
        return regular(cells, "the cells are")
    blocks = [(key, regular(rows, f"the {key} cells are")) for key, rows in cells]
    keys = {key for key, _ in blocks}
    if len(keys) == 1 and keys <= {element.key for element in SIMPLICES.values()}:
        return np.concatenate([rows for _, rows in blocks])
    return blocks


def _check_shape(points: NDArray[np.float64]) -> None:
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InvalidMeshError(f"points have the shape {points.shape}; (n, 2) or (n, 3) is needed")


def _checked_simplices(
    points: NDArray[np.float64], simplices: NDArray[np.integer[Any]], threads: int
) -> NDArray[np.int32]:
    """Check shapes and indices; return the simplices as (m, d+1) int32."""
    _check_shape(points)
    n, d = points.shape
    if simplices.ndim == 2 and simplices.shape[1] == 3:
        d = 2  # also in space
    if simplices.ndim != 2 or simplices.shape[1] != d + 1 or simplices.dtype.kind not in "iu":
        raise InvalidMeshError(f"simplices have the shape {simplices.shape}; (m, {d + 1}) integers are needed")
    if len(simplices) == 0:
        raise InvalidMeshError("the mesh has no elements")
    if simplices.size >= 2**31 or n >= 2**31:
        raise InvalidMeshError("the mesh is too large: 536 million tetrahedra are the limit")
    # What does not fit in 32 bits is outside as well.
    small = simplices if simplices.dtype.itemsize <= 4 else np.clip(simplices, -1, n)
    rows = np.ascontiguousarray(small, dtype=np.int32)
    outside, repeated = kernels.check_simplices(rows, n, threads)
    if outside >= 0:
        raise refers_outside(f"element {outside}", simplices[outside], n)
    if repeated >= 0:
        raise names_twice(repeated, simplices[repeated])
    return rows


def check_coordinates(points: NDArray[np.float64], used: NDArray[np.integer]) -> None:
    """Raise InvalidMeshError where some points cannot be computed with."""
    corners = points if len(used) == len(points) else np.take(points, used, axis=0)
    finite = np.isfinite(corners)
    if not finite.all():
        vertex = int(used[np.argmin(finite.all(axis=1))])
        raise InvalidMeshError(f"vertex {vertex} has a coordinate that is not finite")
    # Column by column: along the rows numpy takes ten times as long.
    low, high = (np.array([find(column) for column in corners.T]) for find in (np.min, np.max))
    if max(-low.min(), high.max()) > LARGEST_COORDINATE:
        raise InvalidMeshError(f"coordinates beyond {LARGEST_COORDINATE:g} cannot be computed with")
    if (high - low).max() < SMALLEST_SIZE:
        raise InvalidMeshError("all vertices are in one point")
