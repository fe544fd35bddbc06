"""Connectivity of elements of any types; that of simplices alone is in `topology.py`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import ELEMENTS, JUDGED, MIXED, Element
from meshfix_cli.mesh.topology import (
    Block,
    Topology,
    crowded_facet,
    names_twice,
    read_only,
    refers_outside,
    turned_over,
)

Blocks = Sequence[tuple[Element, NDArray[np.int32]]]
WIDTH = 4  # vertices of the largest facets
# The edges of all types, as `Connectivity.edges` takes them.
PARALLEL = np.array(
    [
        (code, group, *ends)
        for code, element in enumerate(JUDGED)
        for group, edges in enumerate(element.shape.parallel)
        for ends in edges
    ],
    dtype=np.int8,
)


@dataclass(frozen=True, eq=False)
class MixedTopology(Topology):
    """Connectivity of elements of any types; see `Topology`.

    What is said there of simplices holds here of elements. In the connectivity, `simplices` and what follows from them
    are of the corner simplices, `owners` (s,) tells the element of each; `mates` are of the facets, one element behind
    the other.
    """

    @cached_property
    def element(self) -> Element:
        """Their type, where they have one, or what stands for several."""
        codes = np.unique(self.connectivity.codes)
        return JUDGED[codes[0]] if len(codes) == 1 else MIXED[self.dimension]

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The elements by their types."""
        mesh, blocks = self.connectivity, []
        for code in np.unique(mesh.codes):
            here = np.flatnonzero(mesh.codes == code)
            here = here[np.argsort(mesh.rows[here])]
            nodes = mesh.nodes[mesh.node_offsets[here, None] + np.arange(JUDGED[code].nodes)]
            blocks.append(Block(JUDGED[code], read_only(mesh.rows[here]), read_only(mesh.vertices[nodes])))
        return tuple(blocks)

    @property
    def simplices(self) -> NDArray[np.int32]:
        """There are none: AttributeError; `blocks` are the elements."""
        raise AttributeError("a mesh of elements of any types has no simplices; see `blocks`")

    @cached_property
    def facets(self) -> NDArray[np.int32]:
        """(f, 4) int32: the vertices of each facet in the numbers of the connectivity, from outside; -1: no more."""
        mesh = self.connectivity
        facets = np.full((len(mesh.facet_owners), WIDTH), -1, dtype=np.int32)
        for code in np.unique(mesh.codes):
            here, shape = np.flatnonzero(mesh.codes == code), JUDGED[code].shape
            for position, facet in enumerate(shape.facets):
                vertices = mesh.nodes[mesh.node_offsets[here, None] + np.array(facet)]
                facets[mesh.facet_offsets[here] + position, : len(facet)] = vertices
        return facets

    @cached_property
    def inner(self) -> NDArray[np.bool_]:
        """(m,) bool: elements with a vertex that is not on the boundary."""
        mesh = self.connectivity
        off = ~mesh.boundary().view(bool)
        return self.of_rows(np.logical_or.reduceat(off[mesh.nodes], mesh.node_offsets[:-1]))

    @cached_property
    def mirrored(self) -> NDArray[np.bool_]:
        """(m,) bool: as in `Topology`; also several elements of a type that are all numbered the other way.

        Files have conventions of their own for some types.
        """
        mirrored = super().mirrored
        codes = self.of_rows(self.connectivity.codes)
        group = self.component.astype(np.int64) * len(JUDGED) + codes
        count = np.bincount(group)
        against = np.bincount(group, weights=self.flipped != mirrored)
        return mirrored ^ ((against == count) & (count > 1))[group]

    def interface(self, regions: ArrayLike) -> NDArray[np.bool_]:
        """Mark the vertices of facets between elements of different regions; see `Topology`."""
        mesh = self.connectivity
        labels = np.asarray(regions)[mesh.rows][mesh.facet_owners]
        between = (mesh.facet_mates >= 0) & (labels != labels[mesh.facet_mates])
        mask = np.zeros(len(mesh.vertices) + 1, dtype=bool)
        mask[self.facets[between]] = True  # -1 marks what is cut off
        return self.of_vertices(mask[:-1])

    def facets_between(
        self, regions: NDArray[np.integer] | None
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        """Return the facets of the boundary and between regions, and their elements; see `Topology`."""
        mesh = self.connectivity
        mates = mesh.facet_mates
        is_chosen = mates < 0
        if regions is not None:
            label = np.asarray(regions)[mesh.rows][mesh.facet_owners]
            is_chosen |= label[mates] > label
        chosen = np.flatnonzero(is_chosen)
        width, beyond = 2 if self.dimension == 2 else WIDTH, mates[chosen]
        across = np.where(beyond < 0, -1, mesh.facet_owners[beyond]).astype(np.int32)
        return self.facets[chosen, :width], mesh.facet_owners[chosen], across

    def owners(self, simplices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the elements of corner simplices; see `Topology`."""
        return self.connectivity.owners[simplices]

    def centroids(self, points: NDArray[np.float64], rows: NDArray[np.integer]) -> NDArray[np.float64]:
        """Return the mean of the vertices (r, d) of some elements; see `Topology`."""
        mesh = self.connectivity
        sums = np.add.reduceat(points[mesh.nodes], mesh.node_offsets[:-1])
        return np.asarray((sums / np.diff(mesh.node_offsets)[:, None])[rows])

    def edges(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the two ends (e,) of each edge, once, in the numbers of the connectivity."""
        offsets, ends = self.connectivity.edges(PARALLEL, 1)
        return smaller_ends(offsets), ends


def smaller_ends(offsets: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the smaller end (e,) of each of `Connectivity.edges`."""
    return np.repeat(np.arange(len(offsets) - 1, dtype=np.int32), np.diff(offsets))


def checked_blocks(cells: Sequence[tuple[str, ArrayLike]], n: int, dimension: int) -> Blocks:
    """Check types, shapes and indices of elements; return them with int32 rows.

    Raises
    ------
    InvalidMeshError
        A type that is not judged or of another dimension (those of surfaces have less than the space), indices out of
        range, an element that names a vertex twice.
    """
    blocks, before = [], 0
    if {element.shape.dimension for key, _ in cells if (element := ELEMENTS.get(key)) in JUDGED} == {2}:
        dimension = 2
    for key, values in cells:
        element, rows = ELEMENTS.get(key), np.asarray(values)
        if element not in JUDGED or element.shape.dimension != dimension:
            raise InvalidMeshError(f"elements of type {key} are not solved for in {dimension} dimensions")
        if rows.ndim != 2 or rows.shape[1] != element.nodes or rows.dtype.kind not in "iu":
            raise InvalidMeshError(
                f"{key} elements have the shape {rows.shape}; (m, {element.nodes}) integers are needed"
            )
        outside = ((rows < 0) | (rows >= n)).any(axis=1)
        if outside.any():
            first = int(np.argmax(outside))
            raise refers_outside(f"element {before + first}", rows[first], n)
        ordered = np.sort(rows, axis=1)
        repeated = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
        if repeated.any():
            first = int(np.argmax(repeated))
            raise names_twice(before + first, rows[first])
        blocks.append((element, np.ascontiguousarray(rows, dtype=np.int32)))
        before += len(rows)
    if before == 0:
        raise InvalidMeshError("the mesh has no elements")
    if sum(rows.size for _, rows in blocks) >= 2**29 or n >= 2**31:
        raise InvalidMeshError("the mesh is too large: 67 million hexahedra are the limit")
    return blocks


def build_mixed(points: NDArray[np.float64], blocks: Blocks, used: NDArray[np.int32], threads: int) -> MixedTopology:
    """Orient elements, leave out repetitions and find what is joined; see `topology.build_topology`.

    Parameters
    ----------
    points : (n, d) float64, or (n, 3) of a surface
    blocks : as `checked_blocks` gives them
    used : (k,) int32
        The vertices of elements, ascending.
    threads : int

    Raises
    ------
    InvalidMeshError
        Unless it is a surface: a facet of more than two elements, a Moebius band.
    """
    codes = np.concatenate([np.full(len(rows), JUDGED.index(element), dtype=np.uint8) for element, rows in blocks])
    nodes = np.concatenate([rows.ravel() for _, rows in blocks])
    source: NDArray[np.int32] = np.arange(len(codes), dtype=np.int32)
    mesh = kernels.Connectivity(points, codes, nodes, used, threads)
    shape = MIXED[blocks[0][0].shape.dimension].shape
    if mesh.crowded >= 0 or (points.shape[1] > shape.dimension and _may_repeat(mesh)):
        source = _first_of_each(blocks)
        sizes = np.array([one.nodes for one in JUDGED])[codes]
        kept = np.zeros(len(codes), dtype=bool)
        kept[source] = True
        nodes = nodes[np.repeat(kept, sizes)]
        codes = codes[source]
        mesh = kernels.Connectivity(points, codes, nodes, used, threads)
    if mesh.crowded >= 0:
        raise crowded_facet(shape, _facet_of(mesh, mesh.crowded))
    flipped = turned_over(mesh, points, shape)
    mesh.take_apart(flipped, threads)
    rows = np.zeros_like(flipped)
    rows[mesh.rows] = flipped & mesh.orientable
    return MixedTopology(len(points), source, rows, mesh)


def _may_repeat(mesh: kernels.Connectivity) -> bool:
    """Whether an element of a surface has no neighbour but one, or none: others that have its facets are its like."""
    there = np.where(mesh.facet_mates < 0, -1, mesh.facet_owners[mesh.facet_mates])
    first = mesh.facet_offsets[:-1]
    low, high = np.minimum.reduceat(there, first), np.maximum.reduceat(there, first)
    return bool((low == high).any())


def _first_of_each(blocks: Blocks) -> NDArray[np.int32]:
    """Return the elements (m,), ascending, that repeat none before them; several blocks may have one type."""
    starts = np.cumsum([0, *(len(rows) for _, rows in blocks)])
    kept = []
    for element in dict.fromkeys(element for element, _ in blocks):
        mine = [i for i, (other, _) in enumerate(blocks) if other is element]
        numbers = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in mine])
        ordered = np.sort(np.concatenate([blocks[i][1] for i in mine]), axis=1)
        kept.append(numbers[np.unique(ordered, axis=0, return_index=True)[1]])
    return np.sort(np.concatenate(kept)).astype(np.int32)


def _facet_of(mesh: kernels.Connectivity, facet: int) -> list[int]:
    owner = int(mesh.facet_owners[facet])
    shape = JUDGED[mesh.codes[owner]].shape
    nodes = mesh.nodes[mesh.node_offsets[owner] + np.array(shape.facets[facet - mesh.facet_offsets[owner]])]
    return mesh.vertices[nodes].tolist()
