"""Options that several commands share, and what their values are."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from functools import partial, wraps
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from meshfix_cli.cli.files import given
from meshfix_cli.cli.help import FREEDOM, IN_OUT, METHOD, PROCESS, QUALITY, REPORT, under
from meshfix_cli.cli.names import CELLS, FILE, JSON, PAGE, PLOT
from meshfix_cli.cli.process import cores
from meshfix_cli.quality.metrics import NUMBERS
from meshfix_cli.repair import CURVINGS, MAX_DEVIATION, SLIDES, Files, Held, Method, Morph
from meshfix_cli.repair.judge import Judge
from meshfix_cli.solve.perturb import Distance
from meshfix_cli.solve.strategies import (
    FEATURE_ANGLE,
    RANGES,
    SMOOTH,
    STRATEGIES,
    THRESHOLD,
    senseless_beside_reference,
)

if TYPE_CHECKING:
    from meshfix_cli.quality.requirement import Requirement
    from meshfix_cli.report.facts import Report
    from meshfix_cli.report.terminal import Shown


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
    """A number of smoothing passes, "auto" or "best"."""

    name = "PASSES|auto|best"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value in ("auto", "best"):
            return value
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(
                f"{value!r} is neither a number of passes from 0 to {self.max:,} nor 'auto' or 'best'", param, ctx
            )


class _Requirement(click.ParamType):  # type: ignore[type-arg]
    name = "CONDITION"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from meshfix_cli.quality.requirement import Requirement

        try:
            return value if isinstance(value, Requirement) else Requirement.parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


LENGTH, PERCENT = _Distance(), _Range(*RANGES["percent"])


def _metrics() -> tuple[str, ...]:
    from meshfix_cli.quality.metrics import METRICS

    return tuple(METRICS)


def _readers() -> tuple[str, ...]:
    from meshfix_cli.meshfile.formats import readers

    return readers()


def _formats() -> tuple[str, ...]:
    from meshfix_cli.meshfile.formats import writers

    return writers()


@dataclass(frozen=True)
class Show:
    """How to report."""

    metrics: tuple[str, ...]
    as_json: bool
    quiet: bool
    threads: int = 1

    def __post_init__(self) -> None:
        if self.quiet and self.as_json:
            raise click.UsageError("--quiet and --json exclude each other")

    def judge(self, draw: Draw, requirements: tuple[Requirement, ...] = ()) -> Judge:
        """Return what is to be found out: little where nothing is shown."""
        return Judge(self.metrics, requirements, self.threads, brief=self.quiet and not draw.names)

    def check(self, verbose: bool) -> None:
        """Refuse to tell more and nothing."""
        if verbose and self.quiet:
            raise click.UsageError("--quiet and --verbose exclude each other")

    def live(self, wanted: bool, every_sweep: bool = False) -> Shown:
        """Return what shows on a terminal what is done; `every_sweep`: a line for each of them, also elsewhere."""
        from meshfix_cli.report.terminal import Shown, console

        silent = self.quiet or (self.as_json and not every_sweep)
        return Shown(console(sys.stderr) if wanted and not silent else None, every_sweep)

    def print(self, report: Report, stream: Any, by_type: bool = False) -> None:
        """Print a report as it is asked for; `by_type`: with a table by types of elements."""
        from meshfix_cli.report.terminal import console, print_json, print_report

        if self.as_json:
            print_json(report, console(stream))
        elif not self.quiet:
            print_report(report, console(stream), by_type)


@dataclass(frozen=True)
class Draw:
    """Files that hold the report as a page, as JSON or as pictures."""

    page: str | None
    json: str | None
    plot: str | None

    @property
    def names(self) -> list[str]:
        """Those that are asked for."""
        return given(*astuple(self))

    def check(self) -> None:
        """Find out before any work whether they can be made."""
        if self.plot is not None:
            from meshfix_cli.report.plot import check_plot

            check_plot(self.plot)

    def write(self, report: Report, threads: int) -> None:
        """Draw and write them."""
        from meshfix_cli.meshfile.atomic import write_file, write_text

        if self.json is not None:
            from meshfix_cli.report.as_json import json_line

            write_text(self.json, json_line(report))
        if self.page is None and self.plot is None:
            return
        from meshfix_cli.report.figures import figures

        drawn = figures(report, threads)
        if self.page is not None:
            from meshfix_cli.report.page import page

            write_text(self.page, page(report, drawn, chosen()))
        if self.plot is not None:
            from meshfix_cli.report.plot import plot

            write_file(self.plot, partial(plot, report, drawn))


def chosen() -> dict[str, str]:
    """Return the options of the command that runs, with the values they have."""
    context = click.get_current_context()
    values = {}
    for option in context.command.params:
        value = context.params.get(option.name or "")
        if not isinstance(option, click.Option) or value is None or value is False or value == ():
            continue
        text = " ".join(map(str, value)) if isinstance(value, tuple) else "yes" if value is True else str(value)
        chosen = context.get_parameter_source(option.name or "") is not ParameterSource.DEFAULT
        values[option.opts[0]] = text if chosen else f"{text} (default)"
    return values


def packed(name: str, kind: type, *options: Callable[..., Any]) -> Callable[..., Any]:
    """Add options to a command, which gets their values as one argument `name` of the dataclass `kind`.

    A field without an option has its default.
    """

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(command)
        def with_one(**values: Any) -> Any:
            mine = [field.name for field in fields(kind) if field.name in values]
            values[name] = kind(**{field: values.pop(field) for field in mine})
            return command(**values)

        for option in reversed(options):
            with_one = option(with_one)
        return with_one

    return decorate


holding = packed(
    "held",
    Held,
    under(
        FREEDOM,
        "--fix",
        multiple=True,
        metavar="NAME",
        help="Hold the vertices where this point-data array is not zero, or those of this set or group of points or "
        "cells; may be given more than once. `meshfix quality --verbose` lists groups.",
    ),
    under(
        FREEDOM,
        "--regions",
        metavar="NAME|none",
        help="Hold the interfaces between the regions of this cell-data array; none: let them move.",
    ),
    under(
        IN_OUT, "--input-format", type=_Choice(_readers), metavar="NAME", help="What INPUT is, whatever it looks like."
    ),
    under(IN_OUT, "--join-points", is_flag=True, help="Treat points of exactly equal coordinates as one; write each."),
)
_SHOW = (
    under(QUALITY, "--metric", "metrics", multiple=True, type=_Choice(_metrics), help="Add a metric to the report."),
    under(REPORT, "--json", "as_json", is_flag=True, help="Report as JSON, one object and one line for each mesh."),
    under(REPORT, "--quiet", "-q", is_flag=True, help="Print nothing but errors."),
)
showing = packed("show", Show, *_SHOW)
reporting = packed(
    "show",
    Show,
    *_SHOW,
    under(
        PROCESS,
        "--threads",
        type=click.IntRange(*RANGES["threads"]),
        default=cores,
        help="Default: the cores this process may use; 1 with --mpi.",
    ),
)
_STORE = (
    under(IN_OUT, "--double", is_flag=True, help="Store coordinates in double precision where the file has single."),
    under(
        IN_OUT,
        "--fix-orientation",
        is_flag=True,
        help="Renumber elements whose numbering makes them negative; turn surfaces outwards.",
    ),
    under(IN_OUT, "--backup", is_flag=True, help="Keep the file that OUTPUT replaces, as OUTPUT.bak."),
)
storing = packed("files", Files, *_STORE)


def _output(command: Callable[..., Any]) -> Callable[..., Any]:
    """Let OUTPUT be named by an option as well."""

    @under(IN_OUT, "--output", "-o", type=FILE, metavar="FILE", help="The same as OUTPUT.")
    @wraps(command)
    def with_output(output: str | None, **values: Any) -> Any:
        if output is not None and values["target"] != "-":
            raise click.UsageError("OUTPUT and --output are one and the same: give one of them")
        return command(**values | ({} if output is None else {"target": output}))

    return with_output


writing = packed(
    "files",
    Files,
    _output,
    click.argument("source", metavar="[INPUT]", default="-", type=FILE),
    click.argument("target", metavar="[OUTPUT]", default="-", type=FILE),
    under(IN_OUT, "--format", "form", type=_Choice(_formats), metavar="NAME", help="Format of the output."),
    *_STORE,
    under(IN_OUT, "--dry-run", is_flag=True, help="Do everything but write the mesh."),
)
_SLIDE = (
    under(
        FREEDOM,
        "--slide",
        type=click.Choice(SLIDES),
        default="none",
        show_default=True,
        help="Let vertices of the boundary, or at the edges of a surface, move where that does not change the shape. "
        "flat: in planes and on straight edges; corners and what is curved stay. curved: on smooth surfaces and along "
        "their edges as well, which changes the shape a little.",
    ),
    under(
        FREEDOM,
        "--feature-angle",
        type=_Range(*RANGES["feature_angle"]),
        default=FEATURE_ANGLE,
        show_default=True,
        metavar="DEGREES",
        help="With --slide curved, and on surfaces: facets that meet at a larger angle meet at an edge that stays.",
    ),
)
solving = packed(
    "method",
    Method,
    under(
        METHOD,
        "--strategy",
        type=click.Choice(tuple(STRATEGIES)),
        default="auto",
        show_default=True,
        help="How inverted elements are mended; `meshfix untangle --help` explains the names.",
    ),
    under(
        METHOD,
        "--sweeps",
        type=click.IntRange(*RANGES["sweeps"]),
        help="Untangling sweeps at most, all phases together. [default: as each needs]",
    ),
    under(
        METHOD,
        "--smooth",
        type=_Passes(*RANGES["smooth"]),
        metavar="PASSES|auto|best",
        default=SMOOTH,
        show_default=True,
        help="Smoothing passes; auto: three, and more while angles stay below the threshold; best: then all elements "
        "at once, then the smallest angle up to its ceiling. A million tetrahedra take one core 0.4 s, with best 5 s.",
    ),
    under(
        METHOD,
        "--threshold",
        type=_Range(*RANGES["threshold"]),
        metavar="DEGREES",
        help="Optimise stars with smaller angles or, of elements that are not simplices, scaled Jacobians below its "
        f"sine. [default: {THRESHOLD[2]:g} for plane meshes, {THRESHOLD[3]:g} for solids]",
    ),
    under(FREEDOM, "--max-move", type=LENGTH, help="Move no vertex farther; 0.5h: half a mean edge of INPUT."),
    under(
        FREEDOM, "--only-invalid", is_flag=True, help="Move only what is needed: invalid stars and rings around them."
    ),
    *_SLIDE,
    under(
        FREEDOM,
        "--max-deviation",
        type=LENGTH,
        default=str(MAX_DEVIATION),
        show_default=True,
        help="With --slide curved, and on surfaces: no step takes the middles of edges and facets farther from the "
        "shape. h: a mean edge of the boundary, or of the surface.",
    ),
    under(
        FREEDOM,
        "--slide-interfaces/--no-slide-interfaces",
        default=True,
        show_default=True,
        help="Whether vertices between regions slide as well.",
    ),
    under(
        FREEDOM,
        "--curving",
        type=click.Choice(CURVINGS),
        default="hold",
        show_default=True,
        help="Curved elements: whether curved edges of the boundary become straighter, by as little as is "
        "found to do, where elements cannot be valid otherwise.",
    ),
)
sliding = packed("method", Method, *_SLIDE)
morphing = packed(
    "morph",
    Morph,
    under(
        METHOD,
        "--reference",
        type=FILE,
        metavar="FILE",
        help="The mesh before its boundary moved, with the same elements: they get the shapes back that they have in "
        "it. Of a surface: that on which its vertices move.",
    ),
    under(
        METHOD,
        "--displace",
        metavar="NAME",
        help="Move each point first by its vector in this point-data array, as a morph or a time step gives it; the "
        "mesh as it was is the reference then, unless there is another. With --slide the boundary keeps the shape that "
        "it has got.",
    ),
)


def check_morph(morph: Morph, method: Method) -> None:
    """Refuse what makes no sense with a reference, which these options give."""
    if morph.reference == "-":
        raise click.UsageError("--reference is a file: stdin is INPUT's")
    senseless = senseless_beside_reference(method.only_invalid, method.threshold)
    for option in given(morph.reference and "--reference", morph.displace and "--displace"):
        for other in senseless:
            raise click.UsageError(f"{option} and --{other.replace('_', '-')} exclude each other")


REPORTS = (
    under(REPORT, "--report", "page", type=PAGE, metavar="FILE.html", help="Write the report as a page."),
    under(REPORT, "--report-json", "json", type=JSON, metavar="FILE.json", help="Write the report as JSON."),
)
drawing = packed(
    "draw",
    Draw,
    *REPORTS,
    under(REPORT, "--plot", type=PLOT, metavar="FILE", help="Write the pictures as .png, .svg or .pdf."),
)
drawing_cells = under(
    REPORT, "--cells", type=CELLS, metavar="FILE", help="Write a .vtu or .vtk with the quality of each element."
)
allowing = under(QUALITY, "--allow-inverted", is_flag=True, help="Exit with 0 where inverted elements remain.")
requiring = under(
    QUALITY,
    "--require",
    "requirements",
    type=_Requirement(),
    multiple=True,
    metavar="CONDITION",
    help="What else a result must meet, such as 'min_angle >= 5', or exit with 3 (a batch: 4); may be given more "
    f"than once. Compares {', '.join(NUMBERS)}, or the worst value of a --metric, by >=, <=, >, < or ==.",
)
