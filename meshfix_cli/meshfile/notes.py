"""What a user should know about a mesh before it is solved, a sentence each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import counted
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.topology import Topology
from meshfix_cli.meshfile.coincident import count, first_of_each_place
from meshfix_cli.meshfile.formats import DRAWINGS
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.solved import Solved

if TYPE_CHECKING:
    from meshfix_cli.mesh.ties import Ties

_CURVED = (
    "elements are curved, and are judged so; angles and their ceilings are of straight ones, and curved facets may meet"
)
_CURVED_SURFACE = (
    "elements with more nodes than corners are judged as the straight ones of their corners; those that are curved stay"
)


def notes_on(
    mesh: Mesh, solved: Solved, seen_from_above: bool, copies: NDArray[np.int64] | None, ties: Ties | None
) -> tuple[str, ...]:
    """Return what a user should know about the elements, their orientation, and points that do not move, or as others.

    Parameters
    ----------
    mesh : Mesh
    solved : Solved
    seen_from_above : bool
        The numbering tells how the elements are seen.
    copies : (n,) int64 or None
        See `Document`.
    ties : Ties or None
        See `Document`.
    """
    topology, shape = mesh.topology, mesh.topology.element.shape
    one, many = shape.name, shape.plural
    notes = []
    if topology.m < solved.m:
        repeated = counted(solved.m - topology.m, f"{one} is a repetition", f"{many} are repetitions")
        notes.append(f"{repeated} of another and not counted")
    first = first_of_each_place(mesh.points, np.flatnonzero(topology.boundary)) if copies is None else copies
    together, places = count(first)
    if together and copies is None:
        counts = f"{together:,} points lie at {counted(places, 'place', 'places')}"
        notes.append(f"{counts} and are not joined; --join-points treats those of one place as one")
    elif together:
        notes.append(f"joined {together:,} points at {counted(places, 'place', 'places')}; each is written")
    between = 0 if ties is None else int((ties.nodes & ~topology.used).sum())
    if between:
        follow = counted(between, "node lies between corners and follows", "nodes lie between corners and follow")
        curved = mesh.quadratic is not None
        straight = f"no element is curved: {follow} them"
        notes.append(_CURVED if curved else _CURVED_SURFACE if mesh.surface is not None else straight)
    isolated = topology.n - int(topology.used.sum()) - between - (together - places if copies is not None else 0)
    if isolated:
        notes.append(f"{counted(isolated, 'point belongs', 'points belong')} to no {one} and will not move")
    if not topology.connectivity.orientable:
        notes.append(
            f"the {many} have no common orientation: where two that are numbered alike cannot meet, they are held"
        )
    mirrored, which = int(topology.mirrored.sum()), ""
    if mirrored == topology.m and seen_from_above:
        which = "the element is" if mirrored == 1 else "the elements are"
    elif 0 < mirrored < topology.m:
        which = _types_mirrored(topology) or counted(
            mirrored, f"{one} in a separate part is", f"{many} in separate parts are"
        )
    if which:
        kept = "solved so, and the numbering is kept; --fix-orientation would turn it"
        notes.append(f"{which} numbered the other way round (mirrored): {kept}")
    if not (mesh.movable.any() or (mesh.quadratic is not None and mesh.quadratic.free.any())):
        notes.append("no vertex is free to move")
    return tuple(notes)


def _types_mirrored(topology: Topology) -> str:
    """Name the types that are all numbered the other way round; empty: also others are."""
    whole = [block for block in topology.blocks if topology.mirrored[block.rows].all()]
    if sum(len(block.rows) for block in whole) < topology.mirrored.sum():
        return ""
    named = [counted(len(block.rows), block.element.shape.name, block.element.shape.plural) for block in whole]
    return f"{' and '.join(named)} {'is' if len(whole) == len(whole[0].rows) == 1 else 'are'}"


def concave(mesh: Mesh, form: Format) -> tuple[str, ...]:
    """Say that there are concave quadrilaterals where these may be meant."""
    if form.name not in DRAWINGS:
        return ()
    concave = 0
    for block in mesh.topology.blocks:
        if block.element.key == "quad":
            p = mesh.points[block.vertices]
            ahead, behind = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
            corners = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
            # Where two corners are inside out, sides cross.
            concave += int((((corners <= 0).sum(axis=1) == 1) & (corners.sum(axis=1) > 0)).sum())
    if not concave:
        return ()
    return (f"{counted(concave, 'quadrilateral is', 'quadrilaterals are')} concave, and a concave one is inverted",)
