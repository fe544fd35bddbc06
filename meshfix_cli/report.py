"""Results -> a rich table for people or JSON for programs. The only importer of rich."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from meshfix_cli import __version__
from meshfix_cli.mesh import ANGLE_NAMES, CELL_NAMES, MEASURE_NAMES, Mesh
from meshfix_cli.quality import BIN_WIDTH, Requirement, Summary

if TYPE_CHECKING:
    from meshfix_cli.obstacles import Obstacles
    from meshfix_cli.untangle import SweepRecord

SCHEMA = 1  # raised when a name in the JSON changes its meaning or goes away
LISTED = 10  # inverted elements named in the report

# What can become of a file of a batch, and how it is told.
STATUSES = {"valid": "valid", "invalid": "NOT VALID", "failed": "failed", "skipped": "skipped"}

_BARS = " ▁▂▃▄▅▆▇█"


@dataclass(frozen=True, eq=False)
class Report:
    """All facts about one run, from which the table and the JSON are made.

    Attributes
    ----------
    name, command : str
    meshes : dict
        By the names of the stages; the last is the result, as the file stores it.
    points : callable
        Gives the result (n, 2) or (n, 3) float in the coordinates of the file.
    ids : (m,) int64
        The file's numbers of the simplices.
    stages : dict
        Summaries by name in the order of the table's columns; the last is that of the result. A brief report has no
        others.
    ceiling : float or None
        Degrees; the smallest angle that fixed vertices set.
    obstacles : Obstacles
        What makes a valid mesh impossible.
    fixed : dict
        Number of fixed vertices by reason.
    records : sequence of SweepRecord
    notes : sequence of str
    facts : dict
        Whatever else the command has to tell, under stable names.
    requirements : sequence of Requirement
        What the user asks of the result.
    everything : bool
        List all inverted elements, not only the first.
    """

    name: str
    command: str
    meshes: Mapping[str, Mesh]
    points: Callable[[], NDArray[np.floating[Any]]]
    ids: NDArray[np.int64]
    stages: dict[str, Summary]
    ceiling: float | None
    obstacles: Obstacles
    fixed: dict[str, int]
    records: Sequence[SweepRecord] = ()
    notes: Sequence[str] = ()
    facts: Mapping[str, Any] | None = None
    requirements: Sequence[Requirement] = ()
    everything: bool = False

    @property
    def mesh(self) -> Mesh:
        """The result."""
        return list(self.meshes.values())[-1]

    @property
    def result(self) -> Summary:
        """The summary of the result."""
        return list(self.stages.values())[-1]

    @property
    def misnumbered(self) -> int:
        """Elements numbered against the rest of the mesh: inverted for whoever reads the file, whatever their shape."""
        return int(self.mesh.topology.misnumbered.sum())

    @property
    def valid(self) -> bool:
        """No element is inverted, by shape or by numbering, and no fixed boundary crosses itself."""
        return self.result.inverted == 0 and self.misnumbered == 0 and not self.obstacles

    @property
    def met(self) -> bool:
        """All requirements are."""
        return all(one.holds(self.result) for one in self.requirements)

    @property
    def listed(self) -> int | None:
        """How many elements are listed; None: all."""
        return None if self.everything else LISTED


def console(stream: Any) -> Console:
    """Return a console for a stream; plain text of 100 columns where that is not a terminal."""
    if hasattr(stream, "reconfigure"):
        stream.reconfigure(errors="replace")  # a terminal that lacks a character shows another
    return Console(file=stream, width=None if stream.isatty() else 100, highlight=False)


def print_report(report: Report, out: Console) -> None:
    """Print the quality table, the phases, the notes and a verdict in plain words."""

    def line(text: str, style: str = "") -> None:
        out.print(Text(text, style=style), soft_wrap=True)

    line(title(report))
    out.print(_quality_table(report))
    for text in phases(report):
        line(text)
    for rank, text in enumerate(processes(report)):
        line(f"process {rank}: {text}")
    for note in report.notes:
        line(f"note: {note}")
    for text in verdict(report):
        line(text, "bold green" if report.valid else "bold red")
    for met, text in required(report):
        line(text, "green" if met else "bold red")


def print_json(report: Report, out: Console) -> None:
    """Print one JSON object, on one line."""
    out.file.write(json.dumps(to_json(report), allow_nan=False) + "\n")


def to_json(report: Report) -> dict[str, Any]:
    """Return the facts of the table under stable names; angles in degrees, times in seconds, lengths of the model."""
    mesh = report.mesh
    return {
        "schema": SCHEMA,
        "command": report.command,
        "file": report.name,
        "dimension": mesh.dimension,
        "elements": mesh.topology.m,
        "vertices": int(mesh.topology.used.sum()),
        "free_vertices": int(mesh.movable.sum()),
        "fixed": report.fixed,
        "valid": report.valid,
        "misnumbered": report.misnumbered,
        "mirrored": int(mesh.topology.mirrored.sum()),
        "ceiling": report.ceiling,
        "quality": {stage: _summary_json(summary) for stage, summary in report.stages.items()},
        "first_inverted": [{"id": i, "centroid": c} for i, c in _listed(report)],
        "inverted_without_free_vertex": len(report.obstacles.inverted),
        "obstacles": {
            "inverted": report.ids[report.obstacles.inverted].tolist(),
            "crossing": report.ids[report.obstacles.crossing].tolist(),
        },
        "sweeps": [asdict(record) for record in report.records],
        "notes": list(report.notes),
        "requirements": [
            {"requirement": str(one), "value": _finite(one.value(report.result)), "met": one.holds(report.result)}
            for one in report.requirements
        ],
        **(report.facts or {}),
    }


@dataclass
class Tally:
    """The results of a batch, see `batch.Task.result`, counted as they come.

    Attributes
    ----------
    statuses : Counter
    elements : int
        Of the meshes that were read.
    inverted : [int, int]
        Before and after; files that were skipped count only after.
    angle : [float, float]
        The worst of the smallest angles, degrees.
    """

    statuses: Counter[str] = field(default_factory=Counter)
    elements: int = 0
    inverted: list[int] = field(default_factory=lambda: [0, 0])
    angle: list[float] = field(default_factory=lambda: [math.inf, math.inf])

    def add(self, result: Mapping[str, Any]) -> None:
        """Count one more."""
        self.statuses[result["status"]] += 1
        self.elements += result.get("elements", 0)
        for i, summary in enumerate(before_and_after(result)):
            if summary is not None:
                self.inverted[i] += summary["inverted"]
                self.angle[i] = min(self.angle[i], summary["min_angle"])


def before_and_after(result: Mapping[str, Any]) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Return the first and the last summary of a result; what is not known is None."""
    stages: dict[str, dict[str, Any]] = result.get("quality", {})
    return stages.get("before"), next(reversed(stages.values()), None)


def kept(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the report on a batch keeps of a result."""
    names = ("file", "output", "status", "error", "seconds", "dimension", "elements", "vertices", "valid", "notes")
    before, after = before_and_after(result)
    return {**{name: result.get(name) for name in names}, "before": before, "after": after}


def batch_json(options: Mapping[str, Any], files: Sequence[Mapping[str, Any]], total: int) -> str:
    """Return one JSON object about a batch of so many files, of which some are done: one line for each."""
    head = {"schema": SCHEMA, "version": __version__, "command": "batch", "options": options, "total": total}
    lines = ",\n".join(json.dumps(one, allow_nan=False) for one in files)
    return f'{json.dumps(head, allow_nan=False)[:-1]}, "files": [\n{lines}\n]}}\n'


def print_result(result: Mapping[str, Any], out: Console, as_json: bool) -> None:
    """Print one line at once, so that the log of a batch that is killed tells what was done."""
    if as_json:
        out.file.write(json.dumps(result, allow_nan=False) + "\n")
    elif result["status"] != "failed":
        out.print(Text(_result_line(result)), soft_wrap=True)
    out.file.flush()


def print_tally(tally: Tally, seconds: float, out: Console) -> None:
    """Print the summary of a batch."""
    table, files = Table("", "before", "after"), tally.statuses.total()
    if not files:
        out.print("no file falls to this shard: nothing was done")
        return
    for column in table.columns[1:]:
        column.justify = "right"
    table.add_row("files", "", f"{files:,}")
    for status, label in STATUSES.items():
        table.add_row(label, "", f"{tally.statuses[status]:,}")
    table.add_row("elements", "", f"{tally.elements:,}")
    table.add_row("inverted elements", *(f"{count:,}" for count in tally.inverted))
    table.add_row(
        "smallest angle of all [°]", *(f"{angle:.3f}" if math.isfinite(angle) else "" for angle in tally.angle)
    )
    out.print(table)
    out.print(Text(f"{seconds:.3g} s, {files / max(seconds, 1e-9):,.2f} files a second"))


def with_counts(results: Iterable[dict[str, Any]], total: int, out: Console) -> Iterator[dict[str, Any]]:
    """Pass results through and show on a terminal how many there are; the line is gone while one is looked at."""
    if not out.is_terminal:
        yield from results
        return
    with out.status(f"0 of {total:,} files") as status:
        for done, result in enumerate(results, 1):
            status.stop()
            yield result
            status.update(f"{done:,} of {total:,} files")
            status.start()


def history_csv(records: Iterable[SweepRecord]) -> str:
    """Return a line for each sweep: the series of the paper's figure 4.4."""
    rows = [asdict(record) for record in records]
    lines = [",".join(rows[0])] if rows else []
    return "\n".join(lines + [",".join(str(value) for value in row.values()) for row in rows]) + "\n"


def with_progress(
    run: Iterable[tuple[Mesh, SweepRecord]], out: Console, every_sweep: bool = False
) -> Iterator[tuple[Mesh, SweepRecord]]:
    """Pass the steps through and show them as they come: on a terminal one live line, which is gone at the end.

    `every_sweep`: a plain line for each of them as well.
    """
    if not (out.is_terminal or every_sweep):
        yield from run
        return
    with out.status("building the topology") if out.is_terminal else nullcontext() as status:
        for mesh, record in run:
            text = _sweep(record, mesh.dimension)
            if status is not None:
                status.update(text)
            if every_sweep:
                out.print(Text(f"{text}, {record.moved:,} vertices moved, {record.seconds:.3g} s"), soft_wrap=True)
            yield mesh, record


def _sweep(record: SweepRecord, dimension: int) -> str:
    name = f"{record.phase} {record.sweep}" if record.sweep else record.phase
    return f"{name}: {record.inverted:,} inverted, smallest {MEASURE_NAMES[dimension]} {record.min_measure:.3g}"


def _result_line(result: Mapping[str, Any]) -> str:
    before, after = before_and_after(result)
    parts = [f"{result['file']}: {STATUSES[result['status']]}"]
    if before and after:
        parts.append(f"{before['inverted']:,} inverted -> {after['inverted']:,}")
        parts.append(f"smallest angle {before['min_angle']:.3f}° -> {after['min_angle']:.3f}°")
    parts += [f"NOT MET: {one['requirement']}" for one in result["requirements"] if not one["met"]]
    if result["misnumbered"]:
        parts.append(f"{result['misnumbered']:,} numbered against the rest of the mesh")
    if result["obstacles"]["crossing"]:
        parts.append("the fixed boundary crosses itself")
    return ", ".join([*parts, f"{result['seconds']:.3g} s"])


def _summary_json(summary: Summary) -> dict[str, Any]:
    values = {
        "inverted": summary.inverted,
        "folded": summary.folded,
        "min_measure": summary.min_measure,
        "min_angle": summary.min_angle,
        "max_angle": summary.max_angle,
        "mean_min_angle": summary.mean_min_angle,
        "percentile_1": summary.percentile_1,
        "histogram": {"bin_width": BIN_WIDTH, "counts": list(summary.histogram)},
    }
    finite = {name: [_finite(v) for v in pair] for name, pair in summary.metrics.items()}
    return {**values, "metrics": {name: {"worst": w, "mean": m} for name, (w, m) in finite.items()}}


def _finite(value: float) -> float | None:
    """JSON has no infinity, which is the aspect ratio of an inverted element."""
    return value if abs(value) < float("inf") else None


def title(report: Report) -> str:
    """Return what the mesh is, in one line."""
    mesh = report.mesh
    cells, held = CELL_NAMES[mesh.dimension][1], ", ".join(f"{n:,} {why}" for why, n in report.fixed.items())
    vertices, free = int(mesh.topology.used.sum()), int(mesh.movable.sum())
    return f"{report.name}: {mesh.topology.m:,} {cells}, {vertices:,} vertices: {free:,} free" + (
        f", fixed {held}" if held else ""
    )


def quality_rows(report: Report) -> list[tuple[str, list[str]]]:
    """Return the rows of the quality table: a label, and the value of each stage."""
    flat, stages = report.mesh.dimension == 2, list(report.stages.values())
    angle = ANGLE_NAMES[report.mesh.dimension]

    def row(label: str, form: str, field: str) -> tuple[str, list[str]]:
        return label, [format(getattr(summary, field), form) for summary in stages]

    rows = [
        row("inverted elements", ",", "inverted"),
        row("folded interior edges" if flat else "folded interior faces", ",", "folded"),
        row(f"smallest {MEASURE_NAMES[report.mesh.dimension]}", ".3g", "min_measure"),
        row(f"smallest {angle} [°]", ".3f", "min_angle"),
        row(f"largest {angle} [°]", ".3f", "max_angle"),
        row(f"mean smallest {angle} [°]", ".2f", "mean_min_angle"),
        row("1st percentile [°]", ".2f", "percentile_1"),
    ]
    if report.ceiling is not None:
        rows.append(("ceiling set by fixed vertices [°]", [""] * (len(stages) - 1) + [f"{report.ceiling:.3f}"]))
    for name in report.result.metrics:
        worst = [f"{summary.metrics[name][0]:.3g} / {summary.metrics[name][1]:.3g}" for summary in stages]
        rows.append((f"{name}, worst / mean", worst))
    return rows


def _quality_table(report: Report) -> Table:
    table = Table("")
    for stage in report.stages:
        table.add_column(stage, justify="right")
    for label, values in quality_rows(report):
        table.add_row(label, *values)
    bars = (_bars(summary.histogram) for summary in report.stages.values())
    width = len(report.result.histogram) * BIN_WIDTH
    table.add_row(f"smallest angles, 0 to {width:.0f}°", *bars)
    return table


def _bars(histogram: Sequence[int]) -> str:
    """One character a bin; any element at all shows."""
    top = max(histogram) or 1
    return "".join(_BARS[-(-count * (len(_BARS) - 1) // top)] for count in histogram)


def phases(report: Report) -> Iterator[str]:
    """Give a line for each phase: its sweeps, what is left after the last, and seconds."""
    by_name: dict[str, list[SweepRecord]] = {}
    for record in report.records:
        if record.sweep and record.phase != "best":
            by_name.setdefault(record.phase, []).append(record)
    for name, records in by_name.items():
        left, sweeps, seconds = records[-1], len(records), sum(record.seconds for record in records)
        measure = f"smallest {MEASURE_NAMES[report.mesh.dimension]} {left.min_measure:.3g}"
        yield f"{name}: {sweeps} sweep{'s' * (sweeps > 1)}, {left.inverted:,} inverted, {measure}, {seconds:.3g} s"


def processes(report: Report) -> Iterator[str]:
    """Say of each of several processes what it held and sent."""
    for facts in (report.facts or {}).get("ranks", ()):
        memory = "" if facts["peak_mb"] is None else f", {facts['peak_mb']:,.0f} MB at most"
        held = f"{facts['vertices']:,} vertices and {facts['ghosts']:,} ghosts"
        yield f"{held}{memory}, sent {facts['megabytes']:.3g} MB in {facts['messages']:,} messages"


def verdict(report: Report, listing: bool = True) -> list[str]:
    """Return in plain words how far vertices moved, and whether the mesh is valid; if not, why.

    With `listing`, a line for each inverted element that is listed follows.
    """
    facts = report.facts or {}
    lines = [_perturbed(facts)] if "moved" in facts else [_displaced(facts)] if "displacement" in facts else []
    count = report.result.inverted
    if report.valid:
        return [*lines, "valid: no element is inverted"]
    if count:
        verb = {"untangle": "remains|remain", "perturb": "is now|are now"}.get(report.command, "is|are").split("|")
        text = f"NOT VALID: {count:,} element{'s' * (count > 1)} {verb[count > 1]} inverted"
        if listing:
            text += f"; the first {LISTED}:" if count > LISTED and not report.everything else ":"
        lines.append(text)
    if count and listing:
        lines += [f"  element {i} at ({', '.join(f'{x:.6g}' for x in c)})" for i, c in _listed(report)]
    lines += _impossible(report)
    if report.misnumbered:
        first = report.ids[np.flatnonzero(report.mesh.topology.misnumbered)[: report.listed]].tolist()
        some = ", ".join(map(str, first)) + (", ..." if report.misnumbered > len(first) else "")
        what = "element is" if report.misnumbered == 1 else "elements are"
        text = f"NOT VALID: {report.misnumbered:,} {what} numbered against the rest of the mesh (element {some})"
        lines.append(f"{text}; untangle --fix-orientation renumbers them")
    return lines


def _impossible(report: Report) -> Iterator[str]:
    """Name what no motion of the free vertices can mend."""
    stuck, crossing = report.ids[report.obstacles.inverted], report.ids[report.obstacles.crossing]
    some = slice(report.listed)
    if len(stuck):
        more = ", ..." if len(stuck[some]) < len(stuck) else ""
        which = f"element{'s' * (len(stuck) > 1)} {', '.join(map(str, stuck[some].tolist()))}{more}"
        yield f"IMPOSSIBLE: {len(stuck):,} of them without a free vertex: the fixed ones are wrong ({which})"
    if len(crossing):
        more = ", ..." if len(crossing[some]) < len(crossing) else ""
        which = ", ".join(f"{a} and {b}" for a, b in crossing[some].tolist())
        what = "place" if len(crossing) == 1 else "places"
        yield f"IMPOSSIBLE: the fixed boundary crosses itself in {len(crossing):,} {what} (elements {which}{more})"


def required(report: Report) -> Iterator[tuple[bool, str]]:
    """Yield for each requirement whether it is met, and the same in words."""
    for one in report.requirements:
        met = one.holds(report.result)
        yield met, f"{'met' if met else 'NOT MET'}: {one} (it is {one.value(report.result):g})"


def _displaced(facts: Mapping[str, Any]) -> str:
    far = facts["displacement"]
    return f"moved {far['vertices']:,} vertices by {far['mean']:.3g} in the mean and {far['largest']:.3g} at most"


def _perturbed(facts: Mapping[str, Any]) -> str:
    return f"moved {facts['moved']:,} vertices by {facts['distance']:.6g} (seed {facts['seed']})"


def _listed(report: Report) -> list[tuple[int, list[float]]]:
    first = report.result.inverted_elements[: report.listed]
    if not len(first):
        return []
    centroids = report.points()[report.mesh.topology.simplices[first]].mean(axis=1, dtype=np.float64)
    return [(int(report.ids[i]), c) for i, c in zip(first, centroids.tolist(), strict=True)]
