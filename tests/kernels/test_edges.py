"""The edges of elements of any types, their rows and rings, against sets of pairs and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from elements import MESHES
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import JUDGED
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.mixed import PARALLEL, smaller_ends
from meshfix_cli.solve.chords import inverse_lengths

every = pytest.mark.parametrize("name", sorted(MESHES))
Pair = tuple[int, int]


def groups_of(mesh: kernels.Connectivity) -> list[list[Pair]]:
    """The edges of each element that are parallel in the ideal one, the smaller end first."""
    nodes, offsets, found = mesh.nodes.tolist(), mesh.node_offsets.tolist(), []
    for code, first in zip(mesh.codes.tolist(), offsets[:-1], strict=True):
        for group in JUDGED[code].shape.parallel:
            ends = [sorted((nodes[first + a], nodes[first + b])) for a, b in group]
            found.append([(a, b) for a, b in ends])
    return found


def same_parts(one: NDArray[np.int32], other: NDArray[np.int32]) -> bool:
    """Whether two numberings have the same parts."""
    pairs = set(zip(one.tolist(), other.tolist(), strict=True))
    return len(pairs) == len(set(one.tolist())) == len(set(other.tolist()))


@every
def test_edges_and_their_rows_are_those_of_the_elements(name: str) -> None:
    mesh = Mesh.build(*MESHES[name]()).topology.connectivity
    groups = groups_of(mesh)
    expected = sorted({pair for group in groups for pair in group})
    offsets, ends = mesh.edges(PARALLEL, 1)
    assert list(zip(smaller_ends(offsets).tolist(), ends.tolist(), strict=True)) == expected
    for threads in (2, 3):
        assert [part.tobytes() for part in mesh.edges(PARALLEL, threads)] == [offsets.tobytes(), ends.tobytes()]
    number = {pair: i for i, pair in enumerate(expected)}
    joined = np.array([(number[group[0]], number[pair]) for group in groups for pair in group])
    graph = csr_matrix((np.ones(len(joined)), joined.T), shape=(len(expected),) * 2)
    assert same_parts(mesh.rows_of_edges(PARALLEL, (offsets, ends)), connected_components(graph, directed=False)[1])


@pytest.mark.parametrize("name", ["graded quads", "quads and triangles", "every solid"])
def test_the_embedding_by_weights_is_the_solution_of_the_sparse_system(name: str) -> None:
    mesh = Mesh.build(*MESHES[name]())
    stars, points, free = mesh.topology.stars(), mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
    edges, weights = inverse_lengths(points, stars, free, 1)
    graph = csr_matrix((weights, (smaller_ends(edges[0]), edges[1])), shape=(len(points),) * 2)
    graph = graph + graph.T
    laplacian = (diags(np.asarray(graph.sum(axis=1)).ravel()) - graph).tocsr()
    expected = points.copy()
    expected[free] = spsolve(laplacian[free][:, free].tocsc(), -laplacian[free][:, ~free] @ points[~free])
    embedded = kernels.embedding(points, stars, free, edges, weights, 1)
    assert np.abs(embedded - expected).max() < 1e-3 * mesh.mean_edge_length()
    for threads in (2, 3):
        assert kernels.embedding(points, stars, free, edges, weights, threads).tobytes() == embedded.tobytes()


def test_parallel_edges_get_the_lengths_of_the_boundary() -> None:
    """A grid of quadrilaterals whose columns have two widths: each edge across has the width of its column."""
    x, y = np.array([0.0, 1.0, 4.0]), np.arange(4.0)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(12).reshape(3, 4)
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    mesh = Mesh.build(points, [("quad", np.column_stack([corner.ravel() for corner in corners]))])
    stars, here, free = mesh.topology.stars(), mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
    assert free.sum() == 2
    (offsets, ends), weights = inverse_lengths(here, stars, free, 1)
    length = np.linalg.norm(here[smaller_ends(offsets)] - here[ends], axis=1)
    np.testing.assert_allclose(weights * length, weights[0] * length[0], rtol=1e-12)


@every
def test_rings_are_those_of_the_corner_simplices(name: str, random: np.random.Generator) -> None:
    mesh = Mesh.build(*MESHES[name]())
    stars = mesh.topology.stars()
    marked = random.uniform(size=len(stars.vertices)) < 0.01
    for rings in range(4):
        grown = marked.copy()
        for _ in range(rings):
            grown[stars.simplices[grown[stars.simplices].any(axis=1)]] = True
        np.testing.assert_array_equal(stars.grown(marked, rings).view(bool), grown)
