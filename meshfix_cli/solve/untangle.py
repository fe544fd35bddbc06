"""The one loop that runs the phases of a strategy."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.reference import reference_points
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.solve.records import Outcome, SweepRecord, drain
from meshfix_cli.solve.run import Run
from meshfix_cli.solve.strategies import (
    FEATURE_ANGLE,
    MAX_DEVIATION,
    SMOOTH,
    SWEEPS,
    THRESHOLD,
    Phase,
    Smooth,
    plan,
)
from meshfix_cli.solve.team import Alone

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.team import Team

PATIENCE = 3  # turns through the moves of a phase without progress after which it has stalled


def steps(
    mesh: Mesh,
    phases: Iterable[Phase],
    *,
    sweeps: int | None = None,
    threshold: float | None = None,
    max_move: float = math.inf,
    only_invalid: bool = False,
    hopeless: NDArray[np.bool_] | None = None,
    reference: NDArray[np.float64] | None = None,
    threads: int = 1,
    team: Team | None = None,
) -> Iterator[tuple[Mesh, SweepRecord]]:
    """Run the phases; yield the mesh and a record as it came and after each sweep.

    A valid mesh without an angle below the threshold, but for simplices without a free vertex, is left alone, unless a
    phase goes up to the ceiling, and any valid mesh where there is a reference.

    A phase that starts from the best mesh where that is not the last one begins with a record of phase "best";
    smoothing does. The last mesh is never worse than the first: by inverted elements, then by the smallest measure or,
    where meshes are compared by their scaled Jacobians, by these. Where phases that go up to the ceiling gain nothing,
    it is the first.

    Parameters
    ----------
    sweeps : int, optional
        Limit of the untangling sweeps, all phases together; default: those of each phase alone.
    threshold : float, optional
        Degrees; the active-set method runs on stars with a smaller angle. Default: `THRESHOLD`.
    max_move : float
        No vertex goes farther from where it was, in model units.
    only_invalid : bool
        Move nothing but the stars of inverted elements and the rings around them, as many as it takes.
    hopeless : (m,) bool, optional
        Simplices, in the order of the connectivity, that may be inverted for good: see `Obstacles.hopeless`. Sweeps
        try to mend them, but the energy is not minimised for them.
    reference : (k, d) float64, optional
        Where the vertices, in the order of the connectivity, were before the boundary moved; see `towards.py`.
    threads : int
    team : Team, optional
        The processes of which each has a part of the mesh; the meshes are parts, the records are of the whole.

    Notes
    -----
    Source: section 4; the combined smoothing is that of section 3.3.
    """
    degrees = THRESHOLD[mesh.dimension] if threshold is None else threshold
    if not (0 <= degrees <= 90 and max_move >= 0):
        raise ValueError("the threshold must be from 0 to 90 degrees, and max_move not negative")
    team = Alone(mesh, threads) if team is None else team
    run = Run(mesh, math.sin(math.radians(degrees)) ** 2, max_move, only_invalid, hopeless, threads, team, reference)
    yield run.mesh, run.record
    phases = tuple(phases)
    to_the_ceiling = any(phase.until == "ceiling" for phase in phases)
    as_it_is = only_invalid or reference is not None
    if run.record.inverted == 0 and (as_it_is or (not to_the_ceiling and run.meets(degrees))):
        return
    for phase in phases:
        untangling = not phase.smooths
        if phase.from_best and run.choose():
            yield run.mesh, run.record
        if (phase.shapes == "lost" and run.take_back()) or (phase.shapes in ("mean", "few") and run.take_compared()):
            yield run.mesh, run.record
        if not run.enter(phase):
            continue
        limit = SWEEPS if phase.max_sweeps is None else phase.max_sweeps
        if untangling and sweeps is not None:
            limit = sweeps if phase.max_sweeps is None else min(sweeps, phase.max_sweeps)
        if limit > 0 and phase.from_best and run.go_back(untangling):
            yield run.mesh, run.record
        waited, run.clock = 0, time.perf_counter()
        for points in islice(run.sweeps(phase), limit):
            waited = 0 if run.add(phase, points) else waited + 1
            yield run.mesh, run.record
            if sweeps is not None and untangling:
                sweeps -= 1
            if untangling and run.is_done(phase):
                break
            if len(phase.moves) == 1 and run.record.moved == 0:
                break
            stalls = phase.until == "stalled" or (run.some_are_hopeless and not phase.moves)
            if stalls and waited == PATIENCE * max(1, len(phase.moves)):
                break
            run.clock = time.perf_counter()
        if phase.compares:
            if run.compared is None and run.take_back():  # as the default ends
                yield run.mesh, run.record
            if run.compare():
                yield run.mesh, run.record
    if run.choose() or run.take_back():
        yield run.mesh, run.record
    if run.had_fewer() and run.go_back(untangling=True):  # no smoothing has begun from the best
        yield run.mesh, run.record
    if run.take_compared():
        yield run.mesh, run.record
    first, last = run.first[1], run.record
    # What was compared is no worse than the default in its scaled Jacobians, which tell more than the smallest measure.
    by_measure = run.compared is None and mesh.surface is None
    worse = last.rank > first.rank if by_measure else last.inverted > first.inverted
    lost = worse or (to_the_ceiling and first.inverted == 0 and not run.gained())
    if lost and run.go_back(untangling=False):
        yield run.mesh, run.record


def untangle(
    mesh: Mesh,
    strategy: str = "auto",
    *,
    sweeps: int | None = None,
    smooth: Smooth = SMOOTH,
    threshold: float | None = None,
    max_move: float = math.inf,
    only_invalid: bool = False,
    reference: Mesh | None = None,
    threads: int = 1,
) -> Outcome:
    """Move interior vertices until no element is inverted, then improve the worst angles.

    Parameters
    ----------
    mesh : Mesh
    strategy : str
        A key of `STRATEGIES`.
    smooth : int, "auto" or "best"
        Smoothing passes. "auto": `PASSES` of them, then, while something is below the threshold and gets better, sweeps
        for the mean ratios and more passes around it. "best": as well, then the shape of all elements at
        once, and sweeps that raise the smallest angle until it is that of the simplices without a free vertex or rises
        no more.
    sweeps, threshold, max_move, only_invalid
        See `steps`.
    reference : Mesh, optional
        The same mesh before its boundary moved: elements should have the shapes that they have in it. Of a surface: on
        which the vertices slide.
    threads : int
        The result has the same bits for any number.

    Returns
    -------
    Outcome
        `Outcome.valid` tells whether the mesh could be untangled, `Outcome.obstacles` what makes that impossible.

    Raises
    ------
    ValueError
        There is no such strategy, or an argument is out of range.
    InvalidMeshError
        The reference has other elements; see `reference_points`.

    Notes
    -----
    Source: section 4 for LS, US, CS and LUS, `foldover.py` for FF. "auto" first lets layers follow a wall that has left
    them behind. Else it is Laplacian sweeps until they stall; from the best of those meshes cycles of LP sweeps on the
    stars that are still invalid. Where the Laplacian sweeps left some, the graph's embedding is a second start, and the
    better one is kept. Both are first tried near the inverted elements, where these are few; FF follows, first in the
    smallest region that can be solved.
    """
    places = None if reference is None else reference_points(mesh, reference, threads)
    if mesh.surface is not None:
        from meshfix_cli.mesh import curved
        from meshfix_cli.mesh.surface import laid_by_default
        from meshfix_cli.solve.surface import solved, surface_steps

        def sweeping(smooth: Smooth, surface: Mesh) -> Iterator[tuple[Mesh, SweepRecord]]:
            return steps(
                surface, plan(strategy, smooth, only_invalid), sweeps=sweeps, threshold=threshold, max_move=max_move,
                only_invalid=only_invalid, threads=threads,
            )  # fmt: skip

        shape = curved.Smooth(FEATURE_ANGLE, MAX_DEVIATION * mesh.mean_edge_length(threads))
        laid = laid_by_default(mesh, shape, places, threads)
        return solved(surface_steps(laid, partial(sweeping, 0), partial(sweeping, smooth), max_move, threads), threads)
    phases = plan(strategy, smooth, only_invalid, reference is not None)
    obstacles = find_obstacles(mesh, threads)
    run = steps(
        mesh, phases, sweeps=sweeps, threshold=threshold, max_move=max_move, only_invalid=only_invalid,
        hopeless=obstacles.hopeless(mesh), reference=places, threads=threads,
    )  # fmt: skip
    return Outcome(*drain(run), obstacles)
