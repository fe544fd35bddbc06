"""What is said of boundaries that slide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from meshfix_cli.mesh.elements import counted
from meshfix_cli.report.facts import Report

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh


def sliding(report: Report) -> Iterator[str]:
    """Say how the shape has changed or, where fixed vertices limit the mesh, what sliding would gain."""
    facts = report.facts or {}
    if "shape" in facts and (report.mesh.surface is None or facts["displacement"]["vertices"]):
        tangled = next(iter(report.stages.values())).inverted > 0
        yield from _changed(facts["shape"], report.mesh, tangled)
    if "slide_flat" in facts:
        yield _gain(facts["slide_flat"], report)


def _changed(shape: Mapping[str, Any], mesh: Mesh, tangled: bool) -> Iterator[str]:
    solid, what = mesh.points.shape[1] == 3, "boundary" if mesh.surface is None else "surface"
    size, boundary = ("volume", "area") if solid else ("area", "length")
    within = f", the {size} by {shape['size']:.2g}" if "size" in shape else ""
    changed = f", its {boundary} changed by {shape['boundary']:.2g} of itself{within}"
    if tangled and mesh.surface is not None and not mesh.surface.has_reference:
        changed = ""  # that of a fold says nothing
    yield f"the {what} is within {shape['hausdorff']:.3g} of its shape (Hausdorff distance){changed}"
    if shape["beyond"]:
        facet = "facet" if solid else "edge"
        left = " or left it while elements were inverted, and found no way back" if tangled else ""
        far = counted(shape["beyond"], f"{facet} is", f"{facet}s are")
        yield (
            f"{far} farther from the shape than --max-deviation, {shape['bound']:.3g}, their middles by "
            f"{shape['deviation']:.3g} at most: they came so{left}"
        )
    if shape["folds"]:
        where = counted(shape["folds"], "edge" if solid else "vertex", "edges" if solid else "vertices")
        before = "" if shape.get("displaced") else "; --reference names the mesh before"
        yield (
            f"the {what} itself is folded at {where} and is its own reference: vertices there stay, and others keep "
            f"to it as it is{before}"
        )


def _gain(gain: Mapping[str, Any], report: Report) -> str:
    could = f"{gain['free_vertices']:,} instead of {int(report.mesh.movable.sum()):,} vertices could move"
    unit = "°" if report.mesh.topology.simplicial else ""
    ceiling = "there would be no ceiling"
    if gain["ceiling"] is not None:
        ceiling = f"the ceiling would be {gain['ceiling']:.3f}{unit}"
    option = "--slide flat" if report.command == "untangle" else "untangle --slide flat"
    return f"with {option} {could}, and {ceiling}"
