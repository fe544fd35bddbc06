"""The click commands and their exit codes; nothing else. Whatever is heavy to import is imported by its command."""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import astuple, dataclass, fields, replace
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.core import ParameterSource

from meshfix_cli import __version__
from meshfix_cli.errors import MeshfixError, WriteError
from meshfix_cli.perturb import Distance
from meshfix_cli.repair import Files, Held, Judge, Method, repair
from meshfix_cli.untangle import MOST_PASSES, SMOOTH, STRATEGIES, THRESHOLD

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from mpi4py.MPI import Intracomm

    from meshfix_cli.batch import Result
    from meshfix_cli.distributed import Root
    from meshfix_cli.mesh import Mesh
    from meshfix_cli.meshfile import Document
    from meshfix_cli.meshfile.formats import Format
    from meshfix_cli.quality import Requirement
    from meshfix_cli.repair import Steps
    from meshfix_cli.report import Report

_FILE = click.Path(allow_dash=True)  # shells complete it; whether it exists, its reader tells
VALID, ERROR, INVERTED, SOME_FAILED = 0, 1, 3, 4  # 2, wrong usage, is click's
EXECUTORS = ("processes", "mpi", "dask")
# Where launchers say how many processes they have started: Open MPI, MVAPICH, Hydra and whatever else speaks PMI, and
# srun, which comes last since the others may use it to start one of their own on each machine.
LAUNCHED = ("OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS")


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


class _Passes(click.IntRange):
    """A number of smoothing passes, or "best"."""

    name = "PASSES|best"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "best":
            return value
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is neither a number of passes from 0 to {self.max:,} nor 'best'", param, ctx)


class _Requirement(click.ParamType):  # type: ignore[type-arg]
    name = "CONDITION"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from meshfix_cli.quality import Requirement

        try:
            return value if isinstance(value, Requirement) else Requirement.parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


class _Shard(click.ParamType):  # type: ignore[type-arg]
    name = "I/N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, slice):
            return value
        which, slash, count = value.partition("/")
        if slash and which.isdecimal() and count.isdecimal() and 1 <= int(which) <= int(count):
            return slice(int(which) - 1, None, int(count))
        return self.fail(f"{value!r} is not such as 1/8, the first of eight parts", param, ctx)


class _Group(click.Group):
    """Errors are one line on stderr and an exit code, never a traceback; signals leave no temporary file."""

    def invoke(self, ctx: click.Context) -> Any:
        for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # read when numpy and scipy are loaded, later
            os.environ[name] = "1"  # with more, sums have other bits, and nothing here is large enough to gain
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) != signal.SIG_IGN:  # as nohup does
                signal.signal(getattr(signal, name), _stop)
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
            sys.exit(128 + getattr(signal, "SIGPIPE", 13))
        except OSError as error:
            _fail(str(error))


def _stop(number: int, frame: object) -> NoReturn:
    """End, where there is something to clear up through every `finally`; a second signal must not disturb that.

    Elsewhere at once: in the middle of an import Python may drop an exception.
    """
    del frame
    signal.signal(number, signal.SIG_IGN)
    atomic = sys.modules.get("meshfix_cli.meshfile.atomic")
    if _others or getattr(atomic, "under_way", None):
        sys.exit(128 + number)
    os._exit(128 + number)


# Processes that work for this one, and end with it.
_others: set[str] = set()


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


def _check_input(source: str) -> None:
    if source == "-" and sys.stdin.isatty():
        raise click.UsageError("there is no INPUT, and stdin is a terminal")


def _open(files: Files, held: Held, show: _Show, *others: str | None) -> tuple[Document, Format]:
    """Read INPUT, and find out before any work whether OUTPUT and other files can be written."""
    beside = _given(*others)
    _check_others(beside, files.source, files.target)
    _check_input(files.source)
    document, output = files.open(held, show.threads)
    written = (files.target,) if files.dry_run else document.outputs(files.target, output)
    _check_others(beside, *document.files, *written)
    if files.backup:
        _check_backups(beside, written)
    if output.binary and files.target == "-" and sys.stdout.isatty() and not files.dry_run:
        raise click.UsageError("binary data is not written to a terminal; name an OUTPUT")
    return document, output


def _report_stream(files: Files) -> Any:
    """stderr where the mesh goes to stdout, or to a pipe or device that stdout may be."""
    from meshfix_cli.meshfile import is_stream

    return sys.stderr if is_stream(files.target) and not files.dry_run else sys.stdout


@dataclass(frozen=True)
class _Show:
    """How to report."""

    metrics: tuple[str, ...]
    as_json: bool
    quiet: bool
    threads: int = 1

    def judge(self, draw: _Draw, requirements: tuple[Requirement, ...] = ()) -> Judge:
        return Judge(self.metrics, requirements, self.threads, brief=self.quiet and not draw.names)

    def print(self, report: Report, stream: Any) -> None:
        from meshfix_cli.report import console, print_json, print_report

        if not self.quiet:
            (print_json if self.as_json else print_report)(report, console(stream))


@dataclass(frozen=True)
class _Draw:
    """Files that show the report as a page or as pictures."""

    page: str | None
    plot: str | None

    @property
    def names(self) -> list[str]:
        return _given(*astuple(self))

    def check(self) -> None:
        if self.page is not None and Path(self.page).suffix.lower() == ".json":
            raise click.UsageError(f"{self.page}: --report writes a page in HTML; --json prints the report as JSON")
        if self.plot is not None:
            from meshfix_cli.plot import check_plot

            check_plot(self.plot)

    def write(self, report: Report, threads: int) -> None:
        if not self.names:
            return
        from meshfix_cli.figures import figures
        from meshfix_cli.meshfile import write_file, write_text

        drawn = figures(report, threads)
        if self.page is not None:
            from meshfix_cli.page import page

            write_text(self.page, page(report, drawn, _options()))
        if self.plot is not None:
            from meshfix_cli.plot import plot

            write_file(self.plot, partial(plot, report, drawn))


def _options() -> dict[str, str]:
    """The options of the command that runs, with the values they have."""
    context = click.get_current_context()
    values = {}
    for option in context.command.params:
        value = context.params.get(option.name or "")
        if not isinstance(option, click.Option) or value is None or value is False or value == ():
            continue
        text = " ".join(map(str, value)) if isinstance(value, tuple) else "yes" if value is True else str(value)
        given = context.get_parameter_source(option.name or "") is not ParameterSource.DEFAULT
        values[option.opts[0]] = text if given else f"{text} (default)"
    return values


def _packed(name: str, kind: type, *options: Callable[..., Any]) -> Callable[..., Any]:
    """Add options to a command, which gets their values as one argument `name` of the dataclass `kind`.

    A field without an option has its default.
    """

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(command)
        def packed(**values: Any) -> Any:
            given = [field.name for field in fields(kind) if field.name in values]
            values[name] = kind(**{field: values.pop(field) for field in given})
            return command(**values)

        for option in reversed(options):
            packed = option(packed)
        return packed

    return decorate


_holding = _packed(
    "held",
    Held,
    click.option("--fix", metavar="NAME", help="Hold the vertices where this point-data array is not zero."),
    click.option("--regions", metavar="NAME", help="Hold the interfaces between the regions of this cell-data array."),
)
_SHOW = (
    click.option("--metric", "metrics", multiple=True, type=_Choice(_metrics), help="Add a metric to the report."),
    click.option("--json", "as_json", is_flag=True, help="Report as JSON, one object and one line for each mesh."),
    click.option("--quiet", "-q", is_flag=True, help="Print nothing but errors."),
)
_showing = _packed("show", _Show, *_SHOW)
_reporting = _packed(
    "show",
    _Show,
    *_SHOW,
    click.option(
        "--threads",
        type=click.IntRange(1, 1024),
        default=_cores,
        help="Default: the cores this process may use; 1 with --mpi.",
    ),
)
_STORE = (
    click.option("--double", is_flag=True, help="Store coordinates in double precision where the file has single."),
    click.option("--fix-orientation", is_flag=True, help="Renumber elements whose numbering makes them negative."),
    click.option("--backup", is_flag=True, help="Keep the file that OUTPUT replaces, as OUTPUT.bak."),
)
_storing = _packed("files", Files, *_STORE)
_writing = _packed(
    "files",
    Files,
    click.argument("source", metavar="[INPUT]", default="-", type=_FILE),
    click.argument("target", metavar="[OUTPUT]", default="-", type=_FILE),
    click.option("--format", "form", type=_Choice(_formats), metavar="NAME", help="Format of the output."),
    *_STORE,
    click.option("--dry-run", is_flag=True, help="Do everything but write the mesh."),
)
_solving = _packed(
    "method",
    Method,
    click.option(
        "--strategy",
        type=click.Choice(tuple(STRATEGIES)),
        default="auto",
        show_default=True,
        help="How inverted elements are mended; `meshfix untangle --help` explains the names.",
    ),
    click.option(
        "--sweeps",
        type=click.IntRange(0),
        help="Untangling sweeps at most, all phases together. [default: as each needs]",
    ),
    click.option(
        "--smooth",
        type=_Passes(0, MOST_PASSES),
        metavar="PASSES|best",
        default=SMOOTH,
        show_default=True,
        help="Smoothing passes; best: then the mean, then the smallest angle up to its ceiling. "
        "For a million tetrahedra three passes take 0.4 s, best 2.5 s of one core.",
    ),
    click.option(
        "--threshold",
        type=_Range(0, 90),
        metavar="DEGREES",
        help="Optimise stars with smaller angles. "
        f"[default: {THRESHOLD[2]:g} for triangles, {THRESHOLD[3]:g} for tets]",
    ),
    click.option("--max-move", type=_Distance(), help="Move no vertex farther; 0.5h: half a mean edge of INPUT."),
    click.option("--only-invalid", is_flag=True, help="Move only what is needed: invalid stars and rings around them."),
)
_drawing = _packed(
    "draw",
    _Draw,
    click.option("--report", "page", metavar="FILE.html", help="Write the report as a page with pictures."),
    click.option("--plot", metavar="FILE", help="Write the pictures as .png, .svg or .pdf."),
)
_cells = click.option("--cells", metavar="FILE", help="Write a .vtu or .vtk with the quality of each element.")
_allow = click.option("--allow-inverted", is_flag=True, help="Exit with 0 where inverted elements remain.")
_require = click.option(
    "--require",
    "requirements",
    type=_Requirement(),
    multiple=True,
    metavar="CONDITION",
    help="What else a result must meet, such as 'min_angle >= 5', or exit with 3 (a batch: 4); may be given more "
    "than once.",
)


def _print_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if not wanted or ctx.resilient_parsing:
        return
    import platform
    from importlib.metadata import version

    from meshfix_cli._kernels import BUILD

    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "meshio"))
    threads = f"{_cores()} thread{'s' * (_cores() > 1)}"
    python = f"Python {platform.python_version()}, {libraries}"
    click.echo(f"meshfix {__version__} (kernels for {BUILD}, {threads}; {python})")
    ctx.exit()


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Show the version, and what it runs with.",
)
def main() -> None:
    """Repair tangled triangle and tetrahedral meshes by moving interior vertices.

    INPUT and OUTPUT are files, or - for stdin and stdout; a .pvtu stands for its pieces, and 'mesh_*.msh', in quotes,
    for the parts of a mesh. Exit codes: 0 the mesh is valid, 1 an error (OUTPUT, or a file beside it, was not written),
    2 wrong usage, 3 inverted elements remain, the fixed boundary crosses itself or a --require is not met, 4 some of
    several meshes cannot be read or, in a batch, are not valid.
    """


@main.command()
@_writing
@_solving
@click.option("--history", metavar="FILE", help="Write a CSV line for each sweep.")
@_cells
@_drawing
@_allow
@click.option("--verbose", "-v", is_flag=True, help="Print a line for each sweep on stderr as it comes.")
@click.option("--mpi", is_flag=True, help="Share the mesh among the processes that mpiexec has started.")
@_require
@_holding
@_reporting
def untangle(
    files: Files,
    held: Held,
    show: _Show,
    method: Method,
    history: str | None,
    cells: str | None,
    draw: _Draw,
    allow_inverted: bool,
    verbose: bool,
    mpi: bool,
    requirements: tuple[Requirement, ...],
) -> None:
    """Move interior vertices until no element is inverted, then improve the worst angles.

    Strategies: auto (Laplacian sweeps, the linear programme on stars that are still invalid, then FF where that is not
    enough), FF (the foldover-free energy, minimised over all vertices at once), and the paper's LS (Laplacian), US
    (linear programme), CS (both for each vertex), LUS (3 Laplacian sweeps, then the programme).
    For CONDITION see `meshfix quality --help`.
    """
    from meshfix_cli.meshfile import check_cells, write_text
    from meshfix_cli.report import console, history_csv, with_progress

    if verbose and show.quiet:
        raise click.UsageError("--quiet and --verbose exclude each other")
    if mpi and click.get_current_context().get_parameter_source("threads") is ParameterSource.DEFAULT:
        show = replace(show, threads=1)  # the launcher has a process for each core
        click.get_current_context().params["threads"] = 1
    silent = show.quiet or (show.as_json and not verbose)
    watch = iter if silent else partial(with_progress, out=console(sys.stderr), every_sweep=verbose)
    with _processes(method, show.threads, watch) if mpi else nullcontext() as root:
        if root and files.source == "-":
            raise click.UsageError("with --mpi, INPUT is a file: launchers lose what comes from stdin")
        draw.check()
        document, output = _open(files, held, show, history, cells, *draw.names)
        if cells is not None:
            check_cells(document, cells)
        solve, put = (
            (root.solve, root.put) if root else (partial(method.solve, threads=show.threads, watch=watch), None)
        )
        report = repair(document, output, files, method, show.judge(draw, requirements), solve, put)
        if history is not None:
            write_text(history, history_csv(report.records))
        if cells is not None:
            _write_cells(document, report.mesh, cells, show.threads)
        draw.write(report, show.threads)
        show.print(report, _report_stream(files))
        sys.exit(VALID if (report.valid or allow_inverted) and report.met else INVERTED)


@main.command()
@_writing
@click.option("--percent", type=_Range(0, 100), required=True, help="Of all vertices; interior ones move.")
@click.option("--dist", type=_Distance(), required=True, help="2h: two mean edge lengths; 0.3: model units.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@_drawing
@_holding
@_reporting
def perturb(files: Files, held: Held, show: _Show, draw: _Draw, percent: float, dist: Distance, seed: int) -> None:
    """Tangle a mesh as the paper does: move some interior vertices by a distance in random directions.

    With one seed, the same vertices move in the same directions whatever --percent and --dist are. Exits with 0
    whether or not elements are inverted.
    """
    from meshfix_cli.perturb import perturb as tangle

    draw.check()
    document, output = _open(files, held, show, *draw.names)
    length = dist.length(document.mesh, show.threads)
    perturbed, moved = tangle(document.mesh, percent, length, seed)
    result, notes = files.write(document, perturbed, output)
    facts = {"moved": moved, "distance": length, "percent": percent, "seed": seed}
    stages = {"before": document.mesh, "perturbed": result}
    report = show.judge(draw).report("perturb", document, stages, notes, facts=facts)
    draw.write(report, show.threads)
    show.print(report, _report_stream(files))


@main.command()
@click.argument("sources", metavar="INPUT...", nargs=-1, required=True, type=_FILE)
@_cells
@_drawing
@click.option("--all", "everything", is_flag=True, help="List every inverted element, not the first ten.")
@_require
@_holding
@_reporting
def quality(
    sources: tuple[str, ...],
    cells: str | None,
    draw: _Draw,
    everything: bool,
    requirements: tuple[Requirement, ...],
    held: Held,
    show: _Show,
) -> None:
    """Report the quality of meshes, and where elements are inverted. One unreadable mesh does not stop the others.

    A CONDITION compares a number of the JSON report (inverted, folded, min_measure, min_angle, max_angle,
    mean_min_angle, percentile_1), or the worst value of a --metric, by >=, <=, >, < or ==.
    """
    beside = _given(cells, *draw.names)
    if beside and len(sources) > 1:
        raise click.UsageError("--cells, --report and --plot take one INPUT")
    draw.check()
    codes = set()
    for source in sources:
        try:
            _check_input(source)
            _check_others(beside, source)
            document = held.read(source, show.threads)
            _check_others(beside, *document.files)
            if cells is not None:
                _write_cells(document, document.mesh, cells, show.threads)
            stages = {"mesh": document.mesh}
            report = show.judge(draw, requirements).report("quality", document, stages, everything=everything)
            draw.write(report, show.threads)
        except MeshfixError as error:
            _complain(str(error))
            codes.add(ERROR)
            continue
        show.print(report, sys.stdout)
        codes.add(VALID if report.valid and report.met else INVERTED)
    sys.exit(max(codes) if ERROR not in codes else SOME_FAILED if len(sources) > 1 else ERROR)


@contextmanager
def _processes(method: Method, threads: int, watch: Callable[[Steps], Steps]) -> Iterator[Root]:
    """Give the root those that mpiexec has started; they work for it, and end as it does."""
    from meshfix_cli.distributed import ROOT, Root, serve

    comm = _world()
    _others.add("mpi")
    if comm.rank != ROOT:
        try:
            code = serve(comm, method, threads)
        except BaseException as error:
            _abort(comm, error)
        sys.exit(code)
    root, code = Root(comm, method, threads, watch), ERROR
    try:
        yield root
    except BaseException as error:
        if root.busy:
            _abort(comm, error)
        if isinstance(error, SystemExit) and isinstance(error.code, int):
            code = error.code
        elif isinstance(error, click.ClickException):
            code = error.exit_code
        raise
    finally:
        root.dismiss(code)


def _world() -> Intracomm:
    """Find the processes; until all are there, signals end this one where it is."""
    from meshfix_cli.mpi import world

    handlers = {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        return world(_launched())
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _abort(comm: Intracomm, error: BaseException) -> NoReturn:
    """End all processes with the error of one: the others would wait for it for ever."""
    from meshfix_cli.mpi import abort

    code = error.code if isinstance(error, SystemExit) and isinstance(error.code, int) else ERROR
    try:
        if isinstance(error, (MeshfixError, MemoryError, OSError)):
            _complain(f"process {comm.rank}: {str(error) or type(error).__name__}")
        elif not isinstance(error, SystemExit):  # of a signal
            traceback.print_exception(error)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        abort(comm, code)


def _given(*names: str | None) -> list[str]:
    return [name for name in names if name is not None]


def _check_others(names: list[str], *meshes: str) -> None:
    for i, name in enumerate(names):
        _check_other(name, *meshes, *names[:i])


def _check_backups(names: list[str], written: tuple[str, ...]) -> None:
    backups = tuple(f"{Path(one).resolve().name}.bak" for one in written)
    for name in names:
        if Path(name).resolve().name.startswith(backups):
            raise click.UsageError(f"{name} may be the name of the backup")


def _check_other(name: str, *meshes: str) -> None:
    """A file beside the mesh must not replace one, and can be written."""
    from meshfix_cli.meshfile import check_target

    if name == "-" or _is_stdout(name):
        raise click.UsageError("only the mesh can go to stdout; name a file")
    if not name:
        raise click.UsageError("the name of a file is empty")
    path = Path(name)
    for other in (Path(mesh) for mesh in meshes if mesh != "-"):
        if path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other)):
            raise click.UsageError(f"{name} is the name of a mesh, or of another file to be written")
    check_target(name)


def _is_stdout(name: str) -> bool:
    try:
        return os.path.samestat(Path(name).stat(), os.fstat(1)) and not Path(name).is_file()
    except OSError:
        return False


def _write_cells(document: Document, mesh: Mesh, target: str, threads: int) -> None:
    from meshfix_cli.meshfile import write_cells
    from meshfix_cli.quality import by_element, distances

    cell = {**by_element(mesh, threads), "element": document.ids}
    point = {} if mesh is document.mesh else {"distance_moved": distances(document.mesh, mesh)}
    write_cells(document, mesh, target, cell, point)


@dataclass(frozen=True)
class _Listed:
    """Which files are repaired, and what is kept of them."""

    sources: tuple[str, ...]
    files_from: str | None
    shard: slice | None
    output_dir: str
    report: str | None

    def pairs(self, *, absolute: bool) -> list[tuple[str, str]]:
        """Inputs and outputs, checked before any work."""
        from meshfix_cli.batch import distinct, expanded, named_in, outputs

        if self.report is not None and Path(self.report).suffix.lower() in (".html", ".htm"):
            raise click.UsageError(f"{self.report}: the report on many meshes is JSON")
        if self.files_from is not None:
            _check_input(self.files_from)
        try:
            names = [*expanded(self.sources), *(named_in(self.files_from) if self.files_from is not None else ())]
            sources = distinct(os.path.abspath(name) if absolute else name for name in names)  # noqa: PTH100
            folder = os.path.abspath(self.output_dir) if absolute else self.output_dir  # noqa: PTH100
            pairs = list(zip(sources, outputs(sources, folder, self.report), strict=True))
        except ValueError as error:
            raise click.UsageError(str(error)) from error
        if not pairs:
            raise click.UsageError("there is no IN; name files, or use --files-from")
        _make_folder(folder)
        if self.report is not None:
            _check_other(self.report)
        return pairs[self.shard or slice(None)]


def _make_folder(folder: str) -> None:
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = "is not a folder" if Path(folder).exists() else f"cannot be made: {error.strerror}"
        raise WriteError(f"{folder}: {what}") from error
    if not os.access(folder, os.W_OK):
        raise WriteError(f"{folder}: is not writable")


@dataclass(frozen=True)
class _Run:
    """Where the work is done."""

    executor: str
    scheduler_file: str | None
    jobs: int | None

    @contextmanager
    def workers(self) -> Iterator[tuple[Executor | None, int]]:
        """An executor, None in a process that has worked for another, and how many files it has at once."""
        if (self.executor == "dask") != (self.scheduler_file is not None):
            raise click.UsageError("--executor dask and --scheduler-file go together")
        if self.executor == "processes":
            from meshfix_cli.batch import Pool

            jobs = self.jobs or _cores()
            with Pool(jobs) as pool:
                yield pool, jobs
            return
        with self._cluster() as (executor, count):
            if count == 0:
                click.echo("meshfix: there is no worker yet; waiting for the first", err=True)
            yield executor, self.jobs or 2 * max(1, count)  # one that is worked on, and one that is on its way

    def _cluster(self) -> AbstractContextManager[tuple[Executor | None, int]]:
        if self.scheduler_file is not None:
            from meshfix_cli import dask

            return dask.workers(self.scheduler_file)
        from meshfix_cli import mpi

        return mpi.workers(_world(), _abort)


_listing = _packed(
    "listed",
    _Listed,
    click.argument("sources", metavar="[IN]...", nargs=-1),
    click.option("--output-dir", metavar="DIR", required=True, help="Outputs go here, under the names of the inputs."),
    click.option("--files-from", metavar="FILE|-", help="Read names of more inputs, one a line."),
    click.option("--shard", type=_Shard(), help="Take every N-th file from the I-th on, for job I of N."),
    click.option("--report", metavar="FILE", help="Write the options, and each mesh before and after, as JSON."),
)
_running = _packed(
    "where",
    _Run,
    click.option(
        "--executor",
        type=click.Choice(EXECUTORS),
        default=EXECUTORS[0],
        show_default=True,
        help="Processes on this machine, those that mpiexec has started, or the workers of a Dask cluster.",
    ),
    click.option("--scheduler-file", metavar="FILE", help="Of the Dask cluster."),
    click.option(
        "--jobs",
        type=click.IntRange(1, 1024),
        help="Files at once, each on one thread. [default: a process for each core; of a cluster twice its workers]",
    ),
)


@main.command()
@_listing
@_running
@click.option("--resume", is_flag=True, help="Skip a file whose output is not older, and valid.")
@_storing
@_solving
@_allow
@_require
@_holding
@_showing
def batch(
    listed: _Listed,
    where: _Run,
    resume: bool,
    files: Files,
    method: Method,
    allow_inverted: bool,
    requirements: tuple[Requirement, ...],
    held: Held,
    show: _Show,
) -> None:
    """Untangle many meshes at once, each into the file of its name in another folder.

    IN is a file or a quoted pattern such as 'run*/**/*.vtk'. A bad file costs only itself. Prints a line for each as
    it is done, then a summary. Exits with 0 where all are valid, and with 4 where some are not or failed.
    """
    from meshfix_cli.batch import Task, run
    from meshfix_cli.meshfile import write_text
    from meshfix_cli.report import batch_json, kept

    _others.add("workers")
    with where.workers() as (executor, in_flight):
        if executor is None:
            return
        pairs = listed.pairs(absolute=where.executor == "dask")
        judge = Judge(show.metrics, requirements, brief=show.quiet and listed.report is None)
        task = Task(files, held, method, judge, resume)
        passed, done = True, {}
        try:
            for result in _told(run(executor, (task.at(*pair) for pair in pairs), in_flight), len(pairs), show):
                passed &= _passes(result, allow_inverted)
                if listed.report is not None:
                    done[result["file"]] = kept(result)
        finally:  # also where the batch is stopped
            if listed.report is not None:
                files_done = [done[source] for source, _ in pairs if source in done]
                write_text(listed.report, batch_json(task.options, files_done, len(pairs)))
    sys.exit(VALID if passed else SOME_FAILED)


def _told(results: Iterator[Result], total: int, show: _Show) -> Iterator[Result]:
    """Pass results through and print each, then their summary."""
    from meshfix_cli.report import Tally, console, print_result, print_tally, with_counts

    start, tally, out, plain = time.perf_counter(), Tally(), console(sys.stdout), not (show.quiet or show.as_json)
    for result in with_counts(results, total, console(sys.stderr)) if plain else results:
        if result["status"] == "failed":
            _complain(f"{result['file']}: {result['error'].removeprefix(result['file'] + ': ')}")
        if not show.quiet:
            print_result(result, out, show.as_json)
        tally.add(result)
        yield result
    if plain:
        print_tally(tally, time.perf_counter() - start, out)


def _passes(result: Result, allow_inverted: bool) -> bool:
    if allow_inverted and result["status"] == "invalid":
        return all(one["met"] for one in result["requirements"])
    return result["status"] in ("valid", "skipped")


def _launched() -> int | None:
    """How many processes the launcher of MPI programs says it has started, if there is one."""
    sizes = [os.environ[name] for name in LAUNCHED if name in os.environ]
    return int(sizes[0]) if sizes and sizes[0].isdecimal() else None
