"""Surfaces: untangled in the planes that stars tell where there is no reference, then smoothed on what that gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.surface import in_planes, laid_out, seen
from meshfix_cli.mesh.tangle import Tangle, normals_of_vertices
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.quality.summary import summarise
from meshfix_cli.solve.records import Outcome, SweepRecord, drain
from meshfix_cli.solve.strategies import BACK_TO_SHAPE

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh

ROUNDS = 3  # of untangling, at most: each finds its planes anew
Mask = NDArray[np.bool_]
Steps = Iterator[tuple["Mesh", "SweepRecord"]]


def surface_steps(
    mesh: Mesh, untangle: Callable[[Mesh], Steps], smooth: Callable[[Mesh], Steps], reach: float, threads: int
) -> Steps:
    """Yield a surface and a record, as it came and after each sweep; see `untangle.steps`.

    Where there is no reference, a tangle is undone in planes, and the vertices go back to the surface that all of them
    were on.

    Parameters
    ----------
    mesh : Mesh
        As `surface.laid_out` gives it, whether or not with a shape.
    untangle, smooth : callable
        Run the phases that untangle, and all of them.
    reach : float
        How far vertices may move, in model units: where that is not anywhere, all do so at once.
    threads : int
    """
    surface = mesh.surface
    assert surface is not None and surface.kept is not None
    inverted, smallest = mesh.check(threads)
    if surface.has_reference or inverted == 0:
        yield from smooth(mesh)
        return
    tangle = Tangle.of(mesh, threads)
    if reach < math.inf:
        yield from smooth(laid_out(mesh, surface.kept, threads=threads, tangle=tangle))
        return
    best, first = mesh, True
    for _ in range(ROUNDS):
        flat = moved = in_planes(best, tangle, threads)
        for moved, record in untangle(flat):
            if first:  # as it is seen, not in these planes
                yield mesh, replace(record, inverted=inverted, min_measure=smallest)
            elif record.phase != "input":
                yield _as_before(moved, mesh), record
            first = False
        now, around = _laid_on_sample(moved, flat, mesh, tangle, threads)
        left, measure = now.check(threads)
        if left >= inverted:
            break
        best, tangle, inverted, smallest = now, around.without_doubtful(now, threads), left, measure
        if left == 0:
            break
    if best is mesh:
        best = laid_out(mesh, surface.kept, threads=threads, tangle=tangle)
    gone = int((best.points != moved.points).any(axis=1).sum())
    yield best, SweepRecord(BACK_TO_SHAPE, 1, inverted, smallest, gone, 0.0)  # smoothing may have nothing to do
    for moved, record in smooth(best):
        if record.phase != "input":
            yield moved, record


def solved(run: Steps, threads: int) -> Outcome:
    """Take all steps of a surface.

    Without a reference each of its meshes is seen as it is by itself, not from where it was while vertices moved; what
    is worse so than the first is not taken.
    """
    before, untangled, after, records = drain(run)
    assert before.surface is not None
    if not before.surface.has_reference:
        untangled, after = (one if one is before else _seen_as_it_is(one, threads) for one in (untangled, after))
    if after is not before:
        (left, measure), at_first = after.check(threads), records[0].inverted
        worse = left > at_first or (left == at_first > 0 and _rank(after, threads) > _rank(before, threads))
        if worse:
            after, left, measure = before, at_first, records[0].min_measure
        if worse or left != records[-1].inverted:
            record = replace(records[-1], phase="best", inverted=left, min_measure=measure, moved=0, seconds=0.0)
            records = (*records, record)
    return Outcome(before, untangled, after, records, find_obstacles(after, threads))


def _seen_as_it_is(mesh: Mesh, threads: int) -> Mesh:
    here = seen(mesh, threads).surface
    assert here is not None and mesh.surface is not None
    return replace(mesh, surface=replace(mesh.surface, normals=here.normals))


def _rank(mesh: Mesh, threads: int) -> tuple[int, int, float]:
    """Return how good a surface is: the smaller the better."""
    summary = summarise(mesh, threads=threads)
    return summary.inverted, summary.folded, -summary.smallest


def _as_before(moved: Mesh, mesh: Mesh) -> Mesh:
    """Return a mesh on its way with what slides where in the one that came."""
    return replace(moved, freedom=mesh.freedom, movable=mesh.movable)


def _laid_on_sample(moved: Mesh, before: Mesh, first: Mesh, tangle: Tangle, threads: int) -> tuple[Mesh, Tangle]:
    """Return a mesh of which the vertices that have moved are on the surface that all of them were on at first.

    With it the tangle, of which these are a part.
    """
    assert first.surface is not None and first.surface.kept is not None
    there, here = (one.along_curve(one.points) for one in (moved, before))
    gone = (there != here).any(axis=1)
    there = tangle.refitted(there, np.flatnonzero(gone), normals_of_vertices(moved, threads), threads)
    tangle = tangle.with_moved(gone, first, threads)
    mesh = laid_out(seen(moved.with_vertices(there), threads), first.surface.kept, threads=threads, tangle=tangle)
    return mesh, tangle
