"""The click commands and their exit codes; nothing else. Whatever is heavy to import is imported by its command."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from meshfix_cli import __version__
from meshfix_cli.errors import MeshfixError, WriteError
from meshfix_cli.perturb import Distance
from meshfix_cli.untangle import SMOOTH, STRATEGIES, SWEEPS, THRESHOLD

if TYPE_CHECKING:
    from meshfix_cli.mesh import Mesh
    from meshfix_cli.meshfile import Document
    from meshfix_cli.meshfile.formats import Format
    from meshfix_cli.report import Report

VALID, ERROR, INVERTED, SOME_FAILED = 0, 1, 3, 4  # 2, wrong usage, is click's


class _Choice(click.Choice):  # type: ignore[type-arg]
    """A choice whose names come from a module that is imported only when they are needed."""

    def __init__(self, load: Callable[[], tuple[str, ...]]) -> None:
        self._load = load
        self.case_sensitive = True

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        return self._load()


class _Range(click.FloatRange):
    """NaN is in no range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        return number if number == number else self.fail(f"{value!r} is not a number", param, ctx)


class _Distance(click.ParamType):  # type: ignore[type-arg]
    name = "LENGTH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return value if isinstance(value, Distance) else Distance.parse(value)
        except ValueError:
            self.fail(f"{value!r} is neither a length such as 0.3 nor in mean edge lengths such as 2h", param, ctx)


class _Group(click.Group):
    """Errors are one line on stderr and an exit code, never a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
            if getattr(sys, name) is None:  # closed by the shell: >&-
                setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115 (for the whole run)
        try:
            return super().invoke(ctx)
        except MeshfixError as error:
            _fail(str(error))
        except MemoryError:
            _fail("out of memory")
        except BrokenPipeError:  # whoever read our output has gone, and Python would flush to it once more
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(ERROR)
        except OSError as error:
            _fail(str(error))


def _complain(message: str) -> None:
    click.echo(f"meshfix: error: {' '.join(message.split())}", err=True)


def _fail(message: str) -> NoReturn:
    _complain(message)
    sys.exit(ERROR)


def _metrics() -> tuple[str, ...]:
    from meshfix_cli.quality import METRICS

    return tuple(METRICS)


def _formats() -> tuple[str, ...]:
    from meshfix_cli.meshfile.formats import writers

    return writers()


def _cores() -> int:
    """The cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True)
class _Held:
    """What is held still beside the boundary."""

    fix: str | None
    regions: str | None

    def read(self, source: str) -> Document:
        from meshfix_cli.meshfile import read

        if source == "-" and sys.stdin.isatty():
            raise click.UsageError("there is no INPUT, and stdin is a terminal")
        return read(source, self.fix, self.regions)


@dataclass(frozen=True)
class _Files:
    """INPUT and OUTPUT."""

    source: str
    target: str
    form: str | None
    dry_run: bool

    def open(self, held: _Held, *others: str | None) -> tuple[Document, Format]:
        """Read INPUT, and find out before any work whether OUTPUT and other files can be written."""
        from meshfix_cli.meshfile import check_target, output_format

        meshes = [Path(name).resolve() for name in (self.source, self.target) if name != "-"]
        for other in filter(None, others):
            if Path(other).resolve() in meshes:
                raise click.UsageError(f"{other} is the name of a mesh")
            check_target(other)
        if not self.dry_run:
            check_target(self.target)
        document = held.read(self.source)
        output = output_format(document, self.target, self.form)
        if output.binary and self.target == "-" and sys.stdout.isatty() and not self.dry_run:
            raise click.UsageError("binary data is not written to a terminal; name an OUTPUT")
        return document, output

    def write(self, document: Document, mesh: Mesh, output: Format) -> tuple[Mesh, tuple[str, ...]]:
        """Write OUTPUT; return the mesh as the file holds it, and what the user should know."""
        from meshfix_cli.meshfile import write

        if self.dry_run:
            return document.as_stored(mesh), ()
        stored = write(document, mesh, self.target, output)
        if document.is_kept_by(output):
            return stored, ()
        return stored, (f"written anew as {output.name} by meshio: what it does not know of the input is lost",)

    @property
    def report_stream(self) -> Any:
        """stderr where the mesh goes to stdout."""
        return sys.stderr if self.target == "-" and not self.dry_run else sys.stdout


@dataclass(frozen=True)
class _Show:
    """How to report."""

    metrics: tuple[str, ...]
    as_json: bool
    quiet: bool
    threads: int

    def report(
        self, command: str, document: Document, stages: Mapping[str, Mesh], notes: tuple[str, ...] = (), **more: Any
    ) -> Report:
        from meshfix_cli.quality import ceiling, summarise
        from meshfix_cli.report import Report

        result = list(stages.values())[-1]
        return Report(
            name=document.name,
            command=command,
            mesh=result,
            points=document.file_points(result),
            ids=document.ids,
            stages={stage: summarise(mesh, self.metrics, self.threads) for stage, mesh in stages.items()},
            ceiling=ceiling(result, self.threads),
            fixed=document.fixed,
            notes=(*document.notes, *notes),
            **more,
        )

    def print(self, report: Report, stream: Any) -> None:
        from meshfix_cli.report import console, print_json, print_report

        if not self.quiet:
            (print_json if self.as_json else print_report)(report, console(stream))


def _packed(name: str, kind: type, *options: Callable[..., Any]) -> Callable[..., Any]:
    """Add options to a command, which gets their values as one argument `name` of the dataclass `kind`."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(command)
        def packed(**values: Any) -> Any:
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
            return command(**values)

        for option in reversed(options):
            packed = option(packed)
        return packed

    return decorate


_holding = _packed(
    "held",
    _Held,
    click.option("--fix", metavar="NAME", help="Hold the vertices where this point-data array is not zero."),
    click.option("--regions", metavar="NAME", help="Hold the interfaces between the regions of this cell-data array."),
)
_reporting = _packed(
    "show",
    _Show,
    click.option("--metric", "metrics", multiple=True, type=_Choice(_metrics), help="Add a metric to the report."),
    click.option("--json", "as_json", is_flag=True, help="Report as one JSON object."),
    click.option("--quiet", "-q", is_flag=True, help="Print nothing but errors."),
    click.option(
        "--threads", type=click.IntRange(1, 1024), default=_cores, help="Default: the cores this process may use."
    ),
)
_writing = _packed(
    "files",
    _Files,
    click.argument("source", metavar="[INPUT]", default="-"),
    click.argument("target", metavar="[OUTPUT]", default="-"),
    click.option("--format", "form", type=_Choice(_formats), metavar="NAME", help="Format of the output."),
    click.option("--dry-run", is_flag=True, help="Do everything but write the mesh."),
)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="meshfix")
def main() -> None:
    """Repair tangled triangle and tetrahedral meshes by moving interior vertices.

    INPUT and OUTPUT are files, or - for stdin and stdout. Exit codes: 0 the mesh is valid, 1 an error (nothing
    was written), 2 wrong usage, 3 inverted elements remain.
    """


@main.command()
@_writing
@click.option("--strategy", type=click.Choice(tuple(STRATEGIES)), default="auto", show_default=True)
@click.option("--sweeps", type=click.IntRange(0), default=SWEEPS, show_default=True, help="Untangling sweeps at most.")
@click.option("--smooth", type=click.IntRange(0), default=SMOOTH, show_default=True, help="Smoothing passes.")
@click.option(
    "--threshold",
    type=_Range(0, 90),
    metavar="DEGREES",
    help=f"Optimise stars with smaller angles. [default: {THRESHOLD[2]:g} for triangles, {THRESHOLD[3]:g} for tets]",
)
@click.option("--history", metavar="FILE", help="Write a CSV line for each sweep.")
@click.option("--allow-inverted", is_flag=True, help="Exit with 0 where inverted elements remain.")
@_holding
@_reporting
def untangle(
    files: _Files,
    held: _Held,
    show: _Show,
    strategy: str,
    sweeps: int,
    smooth: int,
    threshold: float | None,
    history: str | None,
    allow_inverted: bool,
) -> None:
    """Move interior vertices until no element is inverted, then improve the worst angles.

    Strategies: auto (Laplacian sweeps, then the linear programme on stars that are still invalid), and the paper's
    LS (Laplacian), US (linear programme), CS (both for each vertex), LUS (3 Laplacian sweeps, then the programme).
    """
    from meshfix_cli.report import console, history_csv, with_progress
    from meshfix_cli.untangle import collect, plan, steps

    document, output = files.open(held, history)
    run = steps(document.mesh, plan(strategy, smooth), sweeps=sweeps, threshold=threshold, threads=show.threads)
    outcome = collect(run if show.quiet or show.as_json else with_progress(run, console(sys.stderr)))
    after = document.first_valid_as_stored(outcome.after, outcome.untangled, outcome.before)
    result, notes = files.write(document, after, output)
    if after is not outcome.after:
        notes += ("smoothed positions, rounded as the file stores them, invert elements: written as before",)
    if history is not None:
        _write_text(history, history_csv(outcome.records))
    stages = {"before": outcome.before, "untangled": outcome.untangled, "smoothed": result}
    report = show.report("untangle", document, stages, notes, records=outcome.records, facts={"strategy": strategy})
    show.print(report, files.report_stream)
    sys.exit(VALID if report.valid or allow_inverted else INVERTED)


@main.command()
@_writing
@click.option("--percent", type=_Range(0, 100), required=True, help="Of all vertices; interior ones move.")
@click.option("--dist", type=_Distance(), required=True, help="2h: two mean edge lengths; 0.3: model units.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@_holding
@_reporting
def perturb(files: _Files, held: _Held, show: _Show, percent: float, dist: Distance, seed: int) -> None:
    """Tangle a mesh as the paper does: move some interior vertices by a distance in random directions.

    With one seed, the same vertices move in the same directions whatever --percent and --dist are. Exits with 0
    whether or not elements are inverted.
    """
    from meshfix_cli.perturb import perturb as tangle

    document, output = files.open(held)
    length = dist.length(document.mesh)
    perturbed, moved = tangle(document.mesh, percent, length, seed)
    result, notes = files.write(document, perturbed, output)
    facts = {"moved": moved, "distance": length, "percent": percent, "seed": seed}
    report = show.report("perturb", document, {"before": document.mesh, "perturbed": result}, notes, facts=facts)
    show.print(report, files.report_stream)


@main.command()
@click.argument("sources", metavar="INPUT...", nargs=-1, required=True)
@_holding
@_reporting
def quality(sources: tuple[str, ...], held: _Held, show: _Show) -> None:
    """Report the quality of meshes; writes nothing. One that cannot be read does not stop the others."""
    codes = set()
    for source in sources:
        try:
            document = held.read(source)
        except MeshfixError as error:
            _complain(str(error))
            codes.add(ERROR)
            continue
        report = show.report("quality", document, {"mesh": document.mesh})
        show.print(report, sys.stdout)
        codes.add(VALID if report.valid else INVERTED)
    sys.exit(max(codes) if ERROR not in codes else SOME_FAILED if len(sources) > 1 else ERROR)


def _write_text(target: str, text: str) -> None:
    try:
        Path(target).write_text(text)
    except OSError as error:
        raise WriteError(f"{target}: {error.strerror}") from error
