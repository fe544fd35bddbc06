"""The strategies of section 4 as data, and the one loop that runs them.

Light to import: the command line reads `STRATEGIES` for its help.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import count
from typing import TYPE_CHECKING, Literal

from meshfix_cli import _kernels

if TYPE_CHECKING:
    from meshfix_cli.mesh import Mesh

SWEEPS = 40  # section 4: the untangling stops after 40 sweeps
SMOOTH = 3  # section 4: three passes of smoothing
THRESHOLD = {2: 30.0, 3: 15.0}  # section 3.3, degrees, for triangles and tetrahedra
SMOOTHING = "smoothing"
PATIENCE = 3  # sweeps without fewer inverted elements after which a phase has stalled


class Move(IntEnum):
    """Codes of the vertex moves in kernels/relocate.hpp."""

    LAPLACIAN = 0
    UNTANGLE = 1
    COMBINED_UNTANGLE = 2
    SMART_LAPLACIAN = 3
    COMBINED_SMOOTH = 4


@dataclass(frozen=True)
class Phase:
    """Sweeps of one move.

    Attributes
    ----------
    name : str
        As shown in the report.
    move : Move
    max_sweeps : int or None
        None: as many as the limit of all untangling sweeps leaves.
    until : {"valid", "stalled", "settled"}
        When to stop early. "valid": no element is inverted; "stalled": as well, or their number has not fallen
        below the best for `PATIENCE` sweeps;
        "settled": no vertex moved, which stops every phase.
    only_invalid : bool
        Visit only stars with an inverted element.
    from_best : bool
        Start from the best mesh met so far, that of the input included, not from the last.
    """

    name: str
    move: Move
    max_sweeps: int | None = None
    until: Literal["valid", "stalled", "settled"] = "valid"
    only_invalid: bool = False
    from_best: bool = False


_LAPLACIAN = Phase("Laplacian", Move.LAPLACIAN)
_LP = Phase("LP", Move.UNTANGLE)

STRATEGIES: dict[str, tuple[Phase, ...]] = {
    "auto": (
        replace(_LAPLACIAN, max_sweeps=20, until="stalled"),
        Phase("LP on invalid stars", Move.UNTANGLE, only_invalid=True, from_best=True),
    ),
    "LS": (_LAPLACIAN,),
    "US": (_LP,),
    "CS": (Phase("Laplacian or LP", Move.COMBINED_UNTANGLE),),
    "LUS": (replace(_LAPLACIAN, max_sweeps=3), _LP),
}


@dataclass(frozen=True)
class SweepRecord:
    """What one sweep did.

    Attributes
    ----------
    phase : str
        "input" for the mesh as it came, "best" where an unsuccessful strategy went back to its best mesh.
    sweep : int
        From 1 in each phase.
    inverted : int
        Elements that are not valid after the sweep.
    min_measure : float
        Smallest signed area or volume, in model units.
    moved : int
        Vertices whose position changed.
    seconds : float
        Wall time, the check included; of the input, that of building the stars.
    """

    phase: str
    sweep: int
    inverted: int
    min_measure: float
    moved: int
    seconds: float

    @property
    def rank(self) -> tuple[int, float]:
        """Smaller is better: fewer inverted elements, then a larger smallest measure."""
        return self.inverted, -self.min_measure


@dataclass(frozen=True)
class Outcome:
    """A mesh before, after untangling and after smoothing, with the record of every sweep."""

    before: Mesh
    untangled: Mesh
    after: Mesh
    records: tuple[SweepRecord, ...]

    @property
    def valid(self) -> bool:
        """No element of the result is inverted, by its shape or by its numbering."""
        return self.records[-1].inverted == 0 and not self.after.topology.misnumbered.any()


def plan(strategy: str, smooth: int = SMOOTH) -> tuple[Phase, ...]:
    """Return the phases of a strategy, and `smooth` smoothing passes."""
    return (*STRATEGIES[strategy], Phase(SMOOTHING, Move.COMBINED_SMOOTH, smooth, until="settled", from_best=True))


def steps(
    mesh: Mesh,
    phases: Iterable[Phase],
    *,
    sweeps: int = SWEEPS,
    threshold: float | None = None,
    threads: int = 1,
) -> Iterator[tuple[Mesh, SweepRecord]]:
    """Run the phases; yield the mesh and a record as it came and after each sweep.

    A valid mesh without an angle below the threshold, but for simplices without a free vertex, is left alone.

    A phase that starts from the best mesh where that is not the last one begins with a record of phase "best";
    smoothing does, so the result is never worse than the input.

    Parameters
    ----------
    sweeps : int
        Limit of the untangling sweeps, all phases together.
    threshold : float, optional
        Degrees; the active-set method runs on stars with a smaller angle. Default: `THRESHOLD`.
    threads : int

    Notes
    -----
    Source: section 4; the combined smoothing is that of section 3.3.
    """
    degrees = THRESHOLD[mesh.dimension] if threshold is None else threshold
    start = time.perf_counter()
    _ = mesh.topology.stars  # built now, so that its time is not that of the first sweep
    record = SweepRecord("input", 0, *mesh.check(threads), moved=0, seconds=time.perf_counter() - start)
    best = mesh, record
    yield mesh, record
    if record.inverted == 0 and _meets_target(mesh, degrees, threads):
        return
    for phase in phases:
        if phase.from_best and best[1].rank < record.rank:
            mesh, record = best[0], replace(best[1], phase="best", moved=0, seconds=0.0)
            yield mesh, record
        waited = 0
        for number in count(1) if phase.max_sweeps is None else range(1, phase.max_sweeps + 1):
            if phase.until != "settled":
                if record.inverted == 0 or sweeps == 0:
                    break
                sweeps -= 1
            mesh, record = _sweep(mesh, phase, number, math.sin(math.radians(degrees)) ** 2, threads)
            waited = 0 if record.inverted < best[1].inverted else waited + 1
            best = min(best, (mesh, record), key=lambda pair: pair[1].rank)
            yield mesh, record
            if record.moved == 0 or (phase.until == "stalled" and waited == PATIENCE):
                break


def _meets_target(mesh: Mesh, degrees: float, threads: int) -> bool:
    """Whether no angle is below the threshold, but for those of simplices without a free vertex."""
    free = mesh.topology.simplices[mesh.movable[mesh.topology.simplices].any(axis=1)]
    return bool(_kernels.angles(mesh.points, free, threads)[0].min(initial=math.pi) >= math.radians(degrees))


def _sweep(mesh: Mesh, phase: Phase, number: int, threshold_sine2: float, threads: int) -> tuple[Mesh, SweepRecord]:
    start = time.perf_counter()
    points = mesh.points.copy()
    moved = sum(
        _kernels.relocate(
            phase.move, points, mesh.movable, mesh.topology.stars, blocks, threshold_sine2, phase.only_invalid, threads
        )[1]
        for blocks in mesh.topology.colours
    )
    mesh = mesh.with_points(points)
    inverted, min_measure = mesh.check(threads)
    return mesh, SweepRecord(phase.name, number, inverted, min_measure, moved, time.perf_counter() - start)


def collect(run: Iterator[tuple[Mesh, SweepRecord]]) -> Outcome:
    """Drain the generator of `steps`."""
    mesh, record = next(run)
    before = untangled = mesh
    records = [record]
    for mesh, record in run:
        if record.phase != SMOOTHING:
            untangled = mesh
        records.append(record)
    return Outcome(before, untangled, mesh, tuple(records))


def untangle(
    mesh: Mesh,
    strategy: str = "auto",
    *,
    sweeps: int = SWEEPS,
    smooth: int = SMOOTH,
    threshold: float | None = None,
    threads: int = 1,
) -> Outcome:
    """Move interior vertices until no element is inverted, then improve the worst angles.

    Parameters
    ----------
    mesh : Mesh
    strategy : str
        A key of `STRATEGIES`.
    sweeps : int
        Limit of the untangling sweeps.
    smooth : int
        Smoothing passes.
    threshold : float, optional
        Degrees; see `steps`.
    threads : int
        The result has the same bits for any number.

    Returns
    -------
    Outcome
        `Outcome.valid` tells whether the mesh could be untangled.

    Raises
    ------
    KeyError
        There is no such strategy.

    Notes
    -----
    Source: section 4 for LS, US, CS and LUS. "auto" is Laplacian sweeps until they stall, then, from the best of
    those meshes, LP sweeps on the stars that are still invalid.
    """
    return collect(steps(mesh, plan(strategy, smooth), sweeps=sweeps, threshold=threshold, threads=threads))
