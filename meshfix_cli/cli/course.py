"""How far a run is, which a signal that ends it lets be told, and the best mesh of one that is to keep it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from meshfix_cli.mesh.elements import counted

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.repair import Steps
    from meshfix_cli.report.facts import Report
    from meshfix_cli.solve.records import SweepRecord

# What a run does, and what is told of it where it is ended there; where it solves, its sweeps tell more.
READING, SOLVING, WRITING, JUDGING = "reading", "solving", "writing", "judging"
_ENDED = {
    READING: "while reading; nothing was written",
    SOLVING: "before the first sweep; nothing was written",
    WRITING: "while writing; OUTPUT is what it was, or all of the new mesh",
    JUDGING: "once OUTPUT was written, before the report",
}
_INTO_A_STREAM = "while writing; OUTPUT may have the beginning of the new mesh"
_NOT_WRITTEN = {WRITING: "once solved; nothing was written", JUDGING: "once solved, before the report"}
# What follows a first signal where the best mesh is to be kept.
_FOLLOWS = {
    SOLVING: "the best mesh so far is kept once this sweep is done",
    WRITING: "OUTPUT is completed",
    JUDGING: "the report is completed",
}


class Course:
    """The course of one run.

    Parameters
    ----------
    keep_best : bool
        A first signal lets it end with the best mesh so far.
    dry_run : bool
        The mesh is not written.
    streamed : bool
        It goes to a stream, which has what was written of it when that ends.

    Attributes
    ----------
    doing : str
        What it does now.
    elements : int
        Of the mesh; 0: they are not known yet.
    asked : bool
        A signal has come, and the run is to end with the best mesh.
    """

    def __init__(self, keep_best: bool, dry_run: bool, streamed: bool = False) -> None:
        self.doing, self.elements = READING, 0
        self._keep_best = keep_best
        self._ended = {**_ENDED, **({WRITING: _INTO_A_STREAM} if streamed else {}), **(_NOT_WRITTEN if dry_run else {})}
        self._follows = {**_FOLLOWS, **({WRITING: _FOLLOWS[JUDGING]} if dry_run else {})}
        self._last: SweepRecord | None = None
        self.asked = False
        self._stopped: SweepRecord | None = None

    def begin(self, doing: str, elements: int | None = None) -> None:
        """Take what it does from now on, and of how many elements, once that is known."""
        self.doing = doing
        self.elements = self.elements if elements is None else elements

    def hears(self) -> str:
        """Take a signal, and say what follows; nothing: the run is to be ended."""
        if not self._keep_best or self.asked or self.doing == READING:  # there is nothing better than the input
            return ""
        self.asked = True
        return f"{self._follows[self.doing]}; a second signal ends it without that"

    def ended(self) -> str:
        """Say how far it was when it was ended."""
        if self.doing == SOLVING and self._last is not None:
            return f"interrupted {self._where(self._last)}; nothing was written"
        return f"interrupted {self._ended[self.doing]}"

    def _where(self, record: SweepRecord) -> str:
        left = f"{record.inverted:,} of {counted(self.elements, 'element', 'elements')} inverted"
        return f"in {record.phase}, sweep {record.sweep}, {left}" if record.sweep else f"before the first sweep, {left}"

    def follow(self, run: Steps) -> Steps:
        """Pass the steps of a run through; where it was asked to end, the last one is the best so far."""
        first: tuple[Mesh, SweepRecord] | None = None
        for mesh, record in run:
            step = mesh, record
            if first is None:
                first = best = step
            if record.sweep or self._last is None:
                self._last = record
            able = self._keep_best and _may_end(mesh, first[0])
            if able:
                best = min(best, step, key=lambda one: one[1].rank)
            yield step
            if self.asked and able:
                self._stopped = self._stopped or self._last
                yield from _best(first, best, step)
                return

    def noted(self, report: Report) -> Report:
        """Return a report that tells where the run was interrupted, if it was."""
        if self._stopped is None:
            return report
        where = asdict(self._stopped)
        note = f"interrupted {self._where(self._stopped)}: the best mesh so far was taken"
        facts = {**(report.facts or {}), "interrupted": {name: where[name] for name in ("phase", "sweep", "inverted")}}
        return replace(report, notes=(*report.notes, note), facts=facts)


def _may_end(mesh: Mesh, first: Mesh) -> bool:
    """Whether a mesh is one to end with: vertices of a tangled surface are off it until they are laid on it again."""
    if mesh.surface is None or mesh.surface is first.surface:
        return True
    return mesh.freedom is not first.freedom and mesh.freedom is not None and mesh.freedom.shapes is not None


def _best(first: tuple[Mesh, SweepRecord], *others: tuple[Mesh, SweepRecord]) -> Iterator[tuple[Mesh, SweepRecord]]:
    """Yield the best of some steps where that is not the last: none that is worse than the first.

    Valid meshes are compared by their smallest angle or scaled Jacobian, as smoothing may take from the smallest
    measure what it gives to that; others by the numbers of inverted elements, then by the smallest measure. Each is
    judged once more: the records of straight elements do not tell of curved ones.
    """
    judged = [(mesh.check(), mesh, record) for mesh, record in (first, *others)]
    start = _rank(judged[0][0])
    able = [one for one in judged if _rank(one[0]) <= start]
    (inverted, measure), mesh, _ = min(able, key=lambda one: _merit(one[0], one[1]))
    if mesh is not others[-1][0]:
        record = replace(first[1], phase="best", inverted=inverted, min_measure=measure, seconds=0.0)
        yield mesh.with_points(mesh.points), record  # another one than the input, which it may be


def _rank(judged: tuple[int, float]) -> tuple[int, float]:
    inverted, measure = judged
    return inverted, -measure


def _merit(judged: tuple[int, float], mesh: Mesh) -> tuple[int, float]:
    from meshfix_cli.quality.summary import summarise

    return _rank(judged) if judged[0] else (0, -summarise(mesh).smallest)
