"""Surfaces: untangled in the planes that stars tell where there is no reference, then smoothed on what that gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.surface import (
    feigned,
    in_planes,
    laid_out,
    meets_features,
    normals_of_vertices,
    on_edges,
    seen,
    tangled,
)
from meshfix_cli.mesh.topology import read_only

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.records import SweepRecord

ROUNDS = 3  # of untangling, at most: each finds its planes anew
Mask = NDArray[np.bool_]
Steps = Iterator[tuple["Mesh", "SweepRecord"]]


def surface_steps(
    mesh: Mesh, untangle: Callable[[Mesh], Steps], smooth: Callable[[Mesh], Steps], reach: float, threads: int
) -> Steps:
    """Yield a surface and a record, as it came and after each sweep; see `untangle.steps`.

    Where there is no reference, what a tangle feigns to be features is found out once it is gone: then vertices slide
    on what is left, once more where that frees some.

    Parameters
    ----------
    mesh : Mesh
        As `surface.laid_out` gives it.
    untangle, smooth : callable
        Run the phases that untangle, and all of them.
    reach : float
        How far vertices may move, in model units: where that is not anywhere, all do so at once.
    threads : int
    """
    surface = mesh.surface
    assert surface is not None and surface.kept is not None
    inverted = mesh.check(threads)[0]
    if surface.has_reference or inverted == 0 or reach < math.inf:
        yield from smooth(mesh)
        return
    best, first = mesh, True
    region = tangled(mesh, threads)
    edges = on_edges(mesh, region)
    for _ in range(ROUNDS):
        flat = moved = in_planes(best, region, edges, threads)
        for moved, record in untangle(flat):
            if first or record.phase != "input":
                yield _as_before(moved, mesh), record
            first = False
        now = _laid_on_sample(moved, flat, mesh, region, threads)
        left = now.check(threads)[0]
        if left >= inverted:
            break
        best, inverted = now, left
        region |= tangled(best, threads)
        if left == 0:
            break
    for _ in range(ROUNDS):
        if inverted == 0 and (odd := feigned(best, region)).any():
            yield from (found := _Last(smooth(_only(in_planes(best, region, edges, threads), odd))))
            best = _laid_on_sample(found.mesh, best, mesh, region, threads)
        yield from (found := _Last(smooth(best)))
        if inverted or not meets_features(best, region):
            return
        best = laid_out(seen(found.mesh, threads), surface.kept, threads=threads, region=region)
        if not feigned(best, region).any():
            return


class _Last:
    """The steps of a run but for the first, and the last mesh of them."""

    def __init__(self, run: Steps) -> None:
        self._run = run
        self.mesh: Mesh

    def __iter__(self) -> Steps:
        for mesh, record in self._run:
            self.mesh = mesh
            if record.phase != "input":
                yield mesh, record


def _only(mesh: Mesh, vertices: Mask) -> Mesh:
    """Return a mesh of which some vertices (k,) and their neighbours move, as far as they may."""
    near = mesh.topology.stars().grown(vertices, 1).view(bool)
    return replace(mesh, movable=read_only(mesh.movable & mesh.topology.of_vertices(near)))


def _as_before(moved: Mesh, mesh: Mesh) -> Mesh:
    """Return a mesh on its way with what slides where in the one that came."""
    return replace(moved, freedom=mesh.freedom, movable=mesh.movable)


def _laid_on_sample(moved: Mesh, before: Mesh, first: Mesh, region: Mask, threads: int) -> Mesh:
    """Return a mesh of which the vertices that have moved are on the surface that all of them were on at first."""
    from meshfix_cli.solve.refit import refitted

    assert first.surface is not None and first.surface.kept is not None
    there, here, sample = (one.along_curve(one.points) for one in (moved, before, first))
    rows = np.flatnonzero((there != here).any(axis=1))
    normals, seen_at_first = (normals_of_vertices(one, threads) for one in (moved, first))
    there = refitted(there, rows, normals, sample, seen_at_first, threads)
    return laid_out(seen(moved.with_vertices(there), threads), first.surface.kept, threads=threads, region=region)
