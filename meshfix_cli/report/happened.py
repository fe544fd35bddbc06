"""What is said of what a run has done."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshfix_cli.mesh.elements import counted
from meshfix_cli.solve.quadratic import giving_way

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.records import Outcome


def of_boundary(before: Mesh, after: Mesh, curving: str, reach: float, threads: int) -> tuple[str, ...]:
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


def what_happened(
    outcome: Outcome, after: Mesh, *, all_judged: bool, asked: bool, rounded: int, kind: str
) -> tuple[str, ...]:
    """Say that nothing was to be done, or that the file's numbers are too coarse.

    Parameters
    ----------
    outcome : Outcome
    after : Mesh
        What is written.
    all_judged : bool
        Nothing is held that could not be judged.
    asked : bool
        Better elements were asked for.
    rounded : int
        How many elements are inverted as rounded.
    kind : str
        Of the file's numbers.
    """
    nothing = "no element" if all_judged else "no element that is judged"
    none = "no angle" if after.topology.simplicial else "none"
    if after.quadratic is not None and outcome.after is outcome.before and outcome.valid:
        return (f"{nothing} is inverted, and no coefficient is small: nothing was moved",)
    if outcome.after is outcome.before and outcome.valid:
        if len(outcome.records) > 1:
            return (f"{nothing} is inverted and {none} could be made better: nothing was moved",)
        angles = f" and {none} is below what --threshold asks for" * asked
        return (f"{nothing} is inverted{angles}: nothing was moved",)
    if outcome.records[-1].inverted or not rounded:
        return ()
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


def crossings(pairs: int) -> tuple[str, ...]:
    """Say at how many pairs of elements a surface crosses itself, which is left as it is."""
    if not pairs:
        return ()
    return (f"the surface crosses itself, at {counted(pairs, 'pair', 'pairs')} of elements, and is left so there",)
