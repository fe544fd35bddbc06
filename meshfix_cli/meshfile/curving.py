"""The elements of a file that are curved: which of their nodes may move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, listed
from meshfix_cli.mesh.elements import ELEMENTS, counted, words
from meshfix_cli.mesh.mesh import check_coordinates
from meshfix_cli.mesh.quadratic import Quadratic, is_judged
from meshfix_cli.mesh.topology import distinct
from meshfix_cli.meshfile.solved import Part

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.mesh.ties import Ties

Mask = NDArray[np.bool_]
SAME = 1e-7  # by which shares of corners may differ, and nodes lie at the same place
OFF_PLANE = 1e-6  # of the size of a plane mesh, by which its nodes may lie off


def quadratic_of(
    parts: Sequence[Part],
    curved: Mask,
    mesh: Mesh,
    ties: Ties,
    regions: Iterable[NDArray[np.int64]],
    held: Mask,
    on_cells: Mask,
) -> Quadratic:
    """Return the elements of second or higher order of a mesh of which some are curved.

    Nodes on facets of the boundary and between regions stay, and so do those that are held.

    Parameters
    ----------
    parts : sequence of Part
        The elements of the mesh, see `Document.parts`.
    curved : (m,) bool
    mesh : Mesh
    ties : Ties
        Which node lies between which corners.
    regions : iterable of (m,) int64
    held, on_cells : (n,) bool
        For other reasons, and on other cells of the file, such as those of the boundary.

    Raises
    ------
    ReadError
        An element is curved that is of no type that is judged so.
    """
    _check(parts, curved)
    blocks, rows, start = [], [], 0
    other, highest = held | _alike(ties), max(map(_order_of, parts))
    for part in parts:
        other[_lacking(part, ties, highest)] = True
        here = np.arange(start, start + len(part.vertices))
        start += len(part.vertices)
        if not _is_judged(part):
            other[part.vertices if part.nodes is None else part.nodes] = True
            continue
        assert part.refined is not None
        assert part.nodes is not None
        nodes = np.where(mesh.topology.flipped[here, None], part.nodes[:, part.refined.mirrored], part.nodes)
        blocks.append((part.refined.key, nodes))
        rows.append(here)
    boundary = _on_facets(mesh, ties, [None])
    between = _on_facets(mesh, ties, regions)
    quadratic = Quadratic(blocks, mesh.topology.n, np.concatenate(rows), ties)
    check_coordinates(mesh.points, np.flatnonzero(quadratic.used))
    return quadratic.holding(boundary | between | on_cells | other, boundary & ~other)


def check_plane(
    places: NDArray[np.floating], points: NDArray[np.float64], basis: NDArray[np.float64], ties: Ties
) -> None:
    """Refuse nodes off the plane of the corners.

    Parameters
    ----------
    places : (n, 3) float
        In the coordinates of the file.
    points : (n, 2) float64
        In the plane that the basis (2, 3) spans.
    ties : Ties
    """
    nodes = np.flatnonzero(ties.nodes)
    corner = distinct(np.concatenate([tie.corners.ravel() for tie in ties.groups]))
    normal = np.cross(*basis)
    heights = places.astype(np.float64) @ normal
    size = float(np.ptp(points[corner], axis=0).max())
    rounding = 8 * float(np.finfo(places.dtype).eps) * float(np.abs(places[corner]).max())
    low, high = heights[corner].min() - OFF_PLANE * size - rounding, heights[corner].max() + OFF_PLANE * size + rounding
    off = int(((heights[nodes] < low) | (heights[nodes] > high)).sum())
    if off:
        raise ReadError(
            f"{counted(off, 'node', 'nodes')} between corners {'is' if off == 1 else 'are'} not in their plane"
        )


def _alike(ties: Ties) -> Mask:
    """Mark the nodes (n,) that have one place between the same corners: two sides of a seam, which must not part."""
    mask = np.zeros(ties.n, dtype=bool)
    for tie in ties.groups:
        places = np.hstack([tie.corners, np.rint(tie.weights / SAME).astype(np.int64)])
        number, counts = np.unique(places, axis=0, return_inverse=True, return_counts=True)[1:]
        mask[tie.nodes[counts[number.reshape(-1)] > 1]] = True
    return mask


def _order_of(part: Part) -> int:
    """Return the order of elements that have nodes between corners; 1: they have none."""
    if part.refined is None:
        return 1
    return 2 if part.refined.lattice is None else part.refined.lattice.order


def _lacking(part: Part, ties: Ties, highest: int) -> NDArray[np.integer]:
    """Return nodes (k,) on edges and faces of elements that do not have them: there they must stay in the middle.

    Beside elements of a higher order none of those that elements have on their sides are the same.
    """
    shape = ELEMENTS[part.key].shape
    lower = part.refined is None or _order_of(part) < highest
    own = [] if lower or part.refined is None else [set(np.flatnonzero(weights)) for weights in part.refined.weights]
    faces = [one for one in shape.facets if len(one) == 4 or (len(one) == 3 and highest > 2)]
    sides = [*(ends for edges in shape.parallel for ends in edges), *faces]
    found = [_found(ties, part.vertices[:, list(side)]) for side in sides if set(side) not in own]
    return np.concatenate([np.empty(0, dtype=np.int32), *found])


def _is_judged(part: Part) -> bool:
    return part.refined is not None and is_judged(part.refined) and part.type == part.refined.key


def _check(parts: Sequence[Part], curved: Mask) -> None:
    """Refuse curved elements of types that are not judged."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)]).tolist()
    counts: dict[str, int] = {}
    for part, begin, end in zip(parts, starts, starts[1:], strict=False):
        if not _is_judged(part) and curved[begin:end].any():
            counts[part.type] = counts.get(part.type, 0) + int(curved[begin:end].sum())
    if counts:
        count, named = sum(counts.values()), listed([words(kind)[1] for kind in counts])
        some = f"{count:,} of {counted(len(curved), 'element', 'elements')} {'is' if count == 1 else 'are'} curved"
        raise ReadError(f"{some} ({named}): elements of such types are judged where they are straight")


def _on_facets(mesh: Mesh, ties: Ties, regions: Iterable[NDArray[np.int64] | None]) -> Mask:
    """Mark the nodes (n,) that lie between corners of facets of the boundary or of regions."""
    mask = np.zeros(mesh.topology.n, dtype=bool)
    for labels in regions:
        facets = mesh.topology.facets_between(labels)[0]
        facets = np.where(facets < 0, -1, mesh.topology.connectivity.vertices[facets])
        if facets.shape[1] == 2:
            mask[_found(ties, facets)] = True
            continue
        for size in {3, facets.shape[1]}:
            some = facets[(facets >= 0).sum(axis=1) == size][:, :size]
            edges = np.stack([some, np.roll(some, -1, axis=1)], axis=-1).reshape(-1, 2)
            mask[_found(ties, edges)] = True
            mask[_found(ties, some)] = True
    return mask


def _found(ties: Ties, corners: NDArray[np.integer]) -> NDArray[np.integer]:
    """Return the nodes (k,) that lie between all of some corners (f, w)."""
    nodes: list[NDArray[np.integer]] = [np.empty(0, dtype=np.int32)]
    for tie in ties.groups:
        if tie.corners.shape[1] != corners.shape[1] or not len(corners):
            continue
        number, *others = np.concatenate([np.sort(corners, axis=1), tie.corners]).T.astype(np.int64)
        for column in others:
            number = np.unique(number * (column.max() + 1) + column, return_inverse=True)[1].reshape(-1)
        nodes.append(tie.nodes[np.isin(number[len(corners) :], number[: len(corners)])])
    return np.concatenate(nodes)
