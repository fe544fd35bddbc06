"""Reports on a terminal or in a log."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from meshfix_cli.mesh.elements import MEASURES, counted, words
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.report.as_json import json_line
from meshfix_cli.report.facts import (
    Report,
    binned,
    groups,
    kind_rows,
    phases,
    processes,
    quality_rows,
    required,
    title,
    verdict,
    what_is_fixed,
)
from meshfix_cli.report.plain import plain
from meshfix_cli.report.sliding import sliding
from meshfix_cli.report.tally import STATUSES, Tally, before_and_after, smallest

if TYPE_CHECKING:
    from meshfix_cli.report.live import Line
    from meshfix_cli.solve.records import SweepRecord

_BARS = " ▁▂▃▄▅▆▇█"


def console(stream: Any) -> Console:
    """Return a console for a stream; plain text of 100 columns where that is not a terminal."""
    if hasattr(stream, "reconfigure"):
        stream.reconfigure(errors="replace")  # a terminal that lacks a character shows another
    return _Console(file=stream, width=None if stream.isatty() else 100, highlight=False)


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Let the command line end as it does for whatever else it prints; rich would end with 1."""
        raise BrokenPipeError


def print_report(report: Report, out: Console, by_type: bool = False) -> None:
    """Print the quality table, the phases, the notes and a verdict in plain words.

    With `by_type`, a table of each of several types of elements follows the first.
    """
    _line(out, title(report))
    _print_table(out, list(report.stages), _rows(report))
    types, rows = kind_rows(report)
    if by_type and types:
        _print_table(out, types, rows)
    for text in (*groups(report), *phases(report)):
        _line(out, text)
    for rank, text in enumerate(processes(report)):
        _line(out, f"process {rank}: {text}")
    for note in (*report.notes, *sliding(report)):
        _line(out, f"note: {note}")
    for text in verdict(report):
        _line(out, text, "bold green" if report.valid else "bold red")
    for met, text in required(report):
        _line(out, text, "green" if met else "bold red")


def as_html(report: Report) -> str:
    """Return what a terminal shows of a report, for a notebook."""
    out = _Console(file=io.StringIO(), record=True, width=100, highlight=False)
    print_report(report, out)
    return out.export_html(inline_styles=True, code_format="<pre style='line-height:1.1'>{code}</pre>")


def _line(out: Console, text: str, style: str = "") -> None:
    """Print one line, which a terminal breaks where it ends."""
    out.print(Text(plain(text), style=style), soft_wrap=True)


def print_json(report: Report, out: Console) -> None:
    """Print one JSON object, on one line."""
    out.file.write(json_line(report))


def print_result(result: Mapping[str, Any], out: Console, as_json: bool) -> None:
    """Print one line at once, so that the log of a batch that is killed tells what was done."""
    if as_json:
        out.file.write(json.dumps(result, allow_nan=False) + "\n")
    elif result["status"] != "failed":
        _line(out, _result_line(result))
    out.file.flush()


def print_tally(tally: Tally, seconds: float, out: Console) -> None:
    """Print the summary of a batch."""
    files = tally.statuses.total()
    if not files:
        _line(out, "no file falls to this shard: nothing was done")
        return
    _print_table(out, ["before", "after"], tally.rows())
    _line(out, f"{seconds:.3g} s, {files / max(seconds, 1e-9):,.2f} files a second")


def with_counts(results: Iterable[dict[str, Any]], total: int, out: Console) -> Iterator[dict[str, Any]]:
    """Pass results through and show on a terminal how many there are; the line is gone while one is looked at."""
    files = counted(total, "file", "files")
    with Shown(out) as shown:
        shown.show(f"0 of {files}", 0.0)
        for done, result in enumerate(results, 1):
            shown.hide()
            yield result
            shown.show(f"{done:,} of {files}", done / total)


class Shown:
    """What a run does, shown as it does it: on a terminal in one line, which is gone at the end.

    Parameters
    ----------
    out : Console or None
        None: nothing is shown.
    every_sweep : bool
        Print a plain line for each sweep as well.
    """

    def __init__(self, out: Console | None, every_sweep: bool = False) -> None:
        self._out, self._every_sweep = out, every_sweep
        self._line: Line | None = None

    def __enter__(self) -> Shown:
        return self

    def __exit__(self, *error: object) -> None:
        self.hide()

    def hide(self) -> None:
        """Take the line away until there is more to be shown."""
        if self._line is not None:
            self._line.hide()

    def show(self, what: str, share: float | None = None) -> None:
        """Show what is done now, until something else is, and which share of it, where that is known."""
        if self._out is None or not self._out.is_terminal:
            return
        if self._line is None:
            from meshfix_cli.report.live import Line

            self._line = Line(self._out)
        self._line.show(what, share)

    def follow(self, run: Iterable[tuple[Mesh, SweepRecord]]) -> Iterator[tuple[Mesh, SweepRecord]]:
        """Pass the steps through and show them as they come, and which share of the inverted elements is mended."""
        self.show("building the topology")
        first = 0
        for mesh, record in run:
            text = _sweep(record, mesh.dimension)
            first = first or record.inverted
            self.show(text, max(0.0, 1 - record.inverted / first) if record.inverted else None)
            if self._out is not None and self._every_sweep:
                moved = counted(record.moved, "vertex", "vertices")
                _line(self._out, f"{text}, {moved} moved, {record.seconds:.3g} s")
            yield mesh, record


def _sweep(record: SweepRecord, dimension: int) -> str:
    name = f"{record.phase} {record.sweep}" if record.sweep else record.phase
    return f"{name}: {record.inverted:,} inverted, smallest {MEASURES[dimension]} {record.min_measure:.3g}"


def _result_line(result: Mapping[str, Any]) -> str:
    before, after = before_and_after(result)
    parts = [f"{result['file']}: {STATUSES[result['status']]}"]
    if before and after:
        parts.append(f"{before['inverted']:,} inverted -> {after['inverted']:,}")
        parts.append(_better(before, after))
    parts += [f"NOT MET: {one['requirement']}" for one in result["requirements"] if not one["met"]]
    if result["misnumbered"]:
        parts.append(f"{result['misnumbered']:,} numbered against the rest of the mesh")
    if result["obstacles"]["crossing"]:
        parts.append(f"{what_is_fixed(result['fixed'])} crosses itself")
    if result["obstacles"]["folding"]:
        parts.append(f"{what_is_fixed(result['fixed'])} folds back upon itself")
    if result["obstacles"]["overlapping"]:
        parts.append("separate parts overlap")
    parts += [f"{counted(count, *words(key))} not judged" for key, count in result["not_judged"].items()]
    return ", ".join([*parts, f"{result['seconds']:.3g} s"])


def _better(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    name = "scaled Jacobian" if "scaled_jacobian" in after else "angle"
    return f"smallest {name} {smallest(before)} -> {smallest(after)}"


def _rows(report: Report) -> list[tuple[str, list[str]]]:
    """Return the rows of the quality table, and one of histograms."""
    bars = [_bars(summary.histogram) for summary in report.stages.values()]
    bins = binned(report.mesh)
    width = len(report.result.histogram) * bins.width
    return [*quality_rows(report), (f"{bins.name}s, 0 to {width:.0f}{bins.unit}", bars)]


def _print_table(out: Console, columns: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> None:
    """Print rows of a label and values; where a terminal is too narrow for that, as a list.

    Labels are broken between words; half a number is another number, so values never are.
    """
    widths = [max(map(len, cells)) for cells in zip(columns, *(values for _, values in rows), strict=True)]
    longest_word = max(len(word) for label, _ in rows for word in label.split())
    if longest_word + sum(widths) + 3 * len(columns) + 4 > out.width:
        _print_list(out, columns, rows)
        return
    table = Table("")
    for column, width in zip(columns, widths, strict=True):
        table.add_column(column, justify="right", no_wrap=True, min_width=width)
    for label, values in rows:
        table.add_row(label, *values)
    out.print(table)


def _print_list(out: Console, columns: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> None:
    for label, values in rows:
        out.print(Text(label))
        for column, value in zip(columns, values, strict=True):
            if value:
                _line(out, f"  {column}: {value}")


def _bars(histogram: Sequence[int]) -> str:
    """One character a bin; any element at all shows."""
    top = max(histogram) or 1
    return "".join(_BARS[-(-count * (len(_BARS) - 1) // top)] for count in histogram)
