"""What is said of what a run has done."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import counted
from meshfix_cli.mesh.surface import facets_of
from meshfix_cli.solve.quadratic import giving_way

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.meshfile.document import Document
    from meshfix_cli.repair import Curving
    from meshfix_cli.solve.records import Outcome


def of_boundary(before: Mesh, after: Mesh, curving: Curving, reach: float, threads: int) -> tuple[str, ...]:
    """Say how far curved edges of the boundary gave way, or would have to."""
    assert after.quadratic is not None
    ways = np.linalg.norm(after.points - before.points, axis=1)[after.quadratic.giving]
    if curving == "relax" and (ways > 0).any():
        count = counted(int((ways > 0).sum()), "curved node of the boundary", "curved nodes of the boundary")
        far = f"{ways.max():.3g} ({ways.max() / before.mean_edge_length():.2g}h)"
        return (f"--curving relax moved {count} by at most {far}",)
    found = giving_way(after, before.points, reach, threads) if curving == "hold" and after.check(threads)[0] else None
    if found is None:
        return ()
    many = counted(found[0], "curved node of the boundary", "curved nodes of the boundary")
    far = f"{found[1]:.3g} ({found[1] / before.mean_edge_length():.2g}h)"
    return (f"--curving relax would move {many} by at most {far}, and all elements are valid then",)


def what_happened(document: Document, asked: bool, outcome: Outcome, after: Mesh, rounded: int) -> tuple[str, ...]:
    """Say that nothing was to be done, or that the file's numbers are too coarse: so many are inverted as rounded.

    `asked`: better elements were asked for.
    """
    nothing = "no element that is judged" if document.not_judged else "no element"
    none = "no angle" if document.mesh.topology.simplicial else "none"
    if document.mesh.quadratic is not None and outcome.after is outcome.before and outcome.valid:
        return (f"{nothing} is inverted, and no coefficient is small: nothing was moved",)
    if outcome.after is outcome.before and outcome.valid:
        if len(outcome.records) > 1:
            return (f"{nothing} is inverted and {none} could be made better: nothing was moved",)
        angles = f" and {none} is below what --threshold asks for" * asked
        return (f"{nothing} is inverted{angles}: nothing was moved",)
    if outcome.records[-1].inverted or not rounded:
        return ()
    kind = document.source.points.dtype.name
    way_out = "; --double stores them as they are" if kind == "float32" else ""
    written = "" if after is outcome.after else ", so the mesh before that is written"
    inverted = counted(rounded, "element", "elements")
    return (f"positions rounded to the file's {kind} invert {inverted}{written}{way_out}",)


def folded_at_first(outcome: Outcome, referred: bool) -> tuple[str, ...]:
    """Say from what the shape of a surface was known that was folded; `referred`: a reference was given."""
    surface = outcome.before.surface
    if surface is not None and referred and not surface.has_reference:
        return ("most vertices are far from where the reference has a surface: it is not used",)
    if surface is None or surface.has_reference or outcome.records[0].inverted == 0:
        return ()
    return ("the surface was folded: its shape is what its points tell; --reference names the mesh before",)


def crossings(mesh: Mesh, threads: int) -> tuple[str, ...]:
    """Say where a surface crosses itself, which is left as it is."""
    facets = facets_of(mesh.topology)
    corners = facets[:, 3:4] >= 0
    triangles = np.concatenate([facets[:, :3], facets[corners.ravel()][:, [0, 2, 3]]]) if corners.size else facets
    pairs = kernels.crossings(mesh.along_curve(mesh.points), np.ascontiguousarray(triangles), threads)
    if not len(pairs):
        return ()
    return (f"the surface crosses itself, at {counted(len(pairs), 'pair', 'pairs')} of elements, and is left so there",)
