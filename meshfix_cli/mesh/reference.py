"""The mesh as it was before its boundary moved: where its vertices were."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import JUDGED, Shape, counted
from meshfix_cli.mesh.mesh import Mesh


def reference_points(
    mesh: Mesh, reference: Mesh, threads: int = 1, positions: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the positions of a valid mesh that has the same elements with the same numbers.

    `positions` (n, d): where its points are in space, if it is a plane one and the mesh a surface.

    Returns
    -------
    (k, d) float64
        In the order of the connectivity of `mesh`.

    Raises
    ------
    InvalidMeshError
        The numbers of points or elements differ, an element has other vertices or joins them otherwise, one of the
        reference is inverted, or one of the two lies in a plane and the other does not.
    """
    shape = mesh.topology.element.shape
    ours, theirs = _counts(mesh), _counts(reference)
    if ours != theirs:
        raise InvalidMeshError(f"it has {theirs}, and the mesh {ours}")
    row = _first_difference(mesh, reference)
    if row is not None:
        (_, here), (name, there) = _element(mesh, row), _element(reference, row)
        raise InvalidMeshError(f"its {name} {row} has the vertices {there}, and that of the mesh {here}")
    inverted = reference.check(threads)[0]
    if inverted:
        raise InvalidMeshError(f"{counted(inverted, f'{shape.name} of it is', f'{shape.plural} of it are')} inverted")
    points = reference.points if positions is None else positions
    if points.shape[1] != mesh.points.shape[1]:
        raise InvalidMeshError("of it and the mesh, one lies in a plane and the other is a surface")
    return mesh.along_curve(points)


def _counts(mesh: Mesh) -> str:
    shape = mesh.topology.element.shape
    return f"{counted(len(mesh.points), 'point', 'points')} and {counted(mesh.topology.m, shape.name, shape.plural)}"


def _first_difference(mesh: Mesh, reference: Mesh) -> int | None:
    """Return the first element that is not the same, whichever of its nodes comes first."""
    pairs = list(zip(mesh.topology.blocks, reference.topology.blocks, strict=False))
    alike = len(mesh.topology.blocks) == len(reference.topology.blocks) and all(
        a.element == b.element for a, b in pairs
    )
    if alike and all(np.array_equal(a.rows, b.rows) and np.array_equal(a.vertices, b.vertices) for a, b in pairs):
        return None
    different = _types(mesh) != _types(reference)
    if not different.any():
        for block, other in zip(mesh.topology.blocks, reference.topology.blocks, strict=True):
            here, there = (_joined(one.vertices, block.element.shape) for one in (block, other))
            different[block.rows] = (here != there).any(axis=1)
    return int(np.argmax(different)) if different.any() else None


def _types(mesh: Mesh) -> NDArray[np.uint8]:
    types = np.empty(mesh.topology.m, dtype=np.uint8)
    for block in mesh.topology.blocks:
        types[block.rows] = JUDGED.index(block.element)
    return types


def _joined(vertices: NDArray[np.int32], shape: Shape) -> NDArray[np.int32]:
    """Return, for elements (k, nodes) of a shape, what does not depend on which node comes first.

    These are their vertices, ascending, and which of them are joined by edges.
    """
    order = np.argsort(vertices, axis=1)
    ascending = np.take_along_axis(vertices, order, axis=1)
    if len(shape.simplices) == 1:  # each is joined to every other
        return ascending
    joined = np.zeros((shape.corners, shape.corners), dtype=np.int32)
    for first, *others in shape.simplices:
        joined[first, others] = joined[others, first] = 1
    edges = joined[order[:, :, None], order[:, None, :]]
    return np.concatenate([ascending, edges.reshape(len(vertices), -1)], axis=1)


def _element(mesh: Mesh, row: int) -> tuple[str, list[int]]:
    """Return the name and the vertices of an element."""
    block = next(block for block in mesh.topology.blocks if row in block.rows)
    return block.element.shape.name, block.vertices[np.searchsorted(block.rows, row)].tolist()
