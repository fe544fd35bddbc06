"""What a run tells of itself: a record of each sweep, and the outcome."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshfix_cli.solve.strategies import SMOOTHING

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.quality.obstacles import Obstacles


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
class RankRecord:
    """What one of several processes held and sent.

    Attributes
    ----------
    vertices, ghosts, elements : int
        Its own vertices, those of others of which it had copies, and the elements of its stars.
    peak_mb : float or None
        The most memory it ever had, in 10^6 bytes; None: the system does not tell.
    messages, megabytes : int, float
        What it sent to others in the sweeps.
    """

    vertices: int
    ghosts: int
    elements: int
    peak_mb: float | None
    messages: int
    megabytes: float


@dataclass(frozen=True)
class Outcome:
    """A mesh before, after untangling and after smoothing, the record of every sweep, and what cannot be mended.

    `ranks` are the processes, where there were several; `all_judged` tells whether there was nothing beside the mesh
    that ought to be in it, and is held and not judged.
    """

    before: Mesh
    untangled: Mesh
    after: Mesh
    records: tuple[SweepRecord, ...]
    obstacles: Obstacles
    ranks: tuple[RankRecord, ...] = ()
    all_judged: bool = True

    @property
    def valid(self) -> bool:
        """All is judged, no element is inverted, by its shape or its numbering, and no boundary crosses itself."""
        inverted = self.records[-1].inverted or self.after.topology.misnumbered.any()
        return self.all_judged and not (inverted or self.obstacles)


def drain(run: Iterable[tuple[Mesh, SweepRecord]]) -> tuple[Mesh, Mesh, Mesh, tuple[SweepRecord, ...]]:
    """Take all steps; return the mesh as it came, untangled and smoothed, and the records."""
    run = iter(run)
    mesh, record = next(run)
    before = untangled = mesh
    records, smooths = [record], False
    for mesh, record in run:
        smooths = smooths or record.phase.startswith(SMOOTHING)  # also where it goes back to the best
        if not smooths:
            untangled = mesh
        records.append(record)
    return before, untangled, mesh, tuple(records)


class Clock:
    """Makes the records of a run that is no loop of phases."""

    def __init__(self, mesh: Mesh, threads: int) -> None:
        self.threads, self.points, self.last, self.sweep = threads, mesh.points, "", 0
        self.time = time.perf_counter()

    def record(self, phase: str, mesh: Mesh) -> SweepRecord:
        """Return what a step has made of a mesh since the last."""
        inverted, smallest = mesh.check(self.threads)
        moved = int((mesh.points != self.points).any(axis=1).sum())
        self.sweep = 0 if phase in ("input", "best") else self.sweep + 1 if phase == self.last else 1
        self.points, self.last, now = mesh.points, phase, time.perf_counter()
        record = SweepRecord(phase, self.sweep, inverted, smallest, moved, now - self.time)
        self.time = now
        return record
