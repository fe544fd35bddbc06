"""Elements of cells that are given by their faces."""

from __future__ import annotations

import generate
import numpy as np
import pytest
from readers import faces_of

from meshfix_cli import kernels

HEXAHEDRON = [[0, 1, 2, 3], [7, 6, 5, 4], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]


def cells_of(loops: list[list[int]], owner: list[int], neighbour: list[int], cells: int) -> tuple[np.ndarray, ...]:
    offsets = np.cumsum([0, *map(len, loops)])
    vertices = np.concatenate(loops)
    first, second, third, fourth = (np.asarray(one, dtype=np.int32) for one in (offsets, vertices, owner, neighbour))
    return kernels.cells_of_faces(first, second, third, fourth, cells, 1)


def test_tetrahedra_alone_have_the_nodes_that_they_have_beside_others() -> None:
    points, tets = generate.bracket(0.3, 4)
    loops, owner, inner = faces_of(np.asarray(tets))
    neighbour = [*inner.tolist(), *[-1] * (len(owner) - len(inner))]
    *_, corners, nodes = cells_of(loops.tolist(), owner.tolist(), neighbour, len(tets))
    more = [[len(points) + i for i in loop] for loop in HEXAHEDRON]
    *_, others, beside = cells_of(
        [*loops.tolist(), *more], [*owner.tolist(), *[len(tets)] * 6], [*neighbour, *[-1] * 6], len(tets) + 1
    )
    assert corners.tolist() == [4] * len(tets) and others.tolist() == [*corners.tolist(), 8]
    np.testing.assert_array_equal(nodes, beside[:-1, :4])
    np.testing.assert_array_equal(np.sort(nodes, axis=1), np.sort(tets, axis=1))


@pytest.mark.parametrize("loops", [
    [[0, 1, 2], [0, 3, 1], [1, 3, 2]],  # one is missing
    [[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 4]],  # a fifth vertex
    [[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3], [0, 2, 3]],  # one more
    [[0, 1, 1], [0, 3, 1], [1, 3, 2], [0, 2, 3]],  # a vertex twice
    [[0, 1, 2]] * 4,
])  # fmt: skip
def test_what_is_no_tetrahedron_is_none(loops: list[list[int]]) -> None:
    starts, faces, corners, _ = cells_of(loops, [0] * len(loops), [-1] * len(loops), 1)
    assert corners.tolist() == [0] and starts.tolist() == [0, len(loops)] and faces.tolist() == [*range(len(loops))]
