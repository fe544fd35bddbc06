"""`meshfix untangle`."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from meshfix_cli.cli.course import READING, SOLVING, Course
from meshfix_cli.cli.files import is_streamed, open_files, report_stream, show_stage, write_cells
from meshfix_cli.cli.help import PROCESS, REPORT, Command, under
from meshfix_cli.cli.names import HISTORY
from meshfix_cli.cli.options import (
    Draw,
    Show,
    allowing,
    check_morph,
    drawing,
    drawing_cells,
    holding,
    morphing,
    reporting,
    requiring,
    solving,
    writing,
)
from meshfix_cli.cli.process import INVERTED, VALID, courses, processes
from meshfix_cli.repair import Files, Held, Method, Morph, repair

if TYPE_CHECKING:
    from meshfix_cli.quality.requirement import Requirement
    from meshfix_cli.repair import Steps


EXAMPLES = (
    ("Mend a mesh, and see the table", "meshfix untangle tangled.vtk repaired.vtk"),
    ("In the place of the input, of which a copy is kept", "meshfix untangle --backup mesh.vtk mesh.vtk"),
    ("As good as the boundary lets it be", "meshfix untangle --smooth best tangled.vtk repaired.vtk"),
    ("With the shapes that elements had before a morph", "meshfix untangle --reference mesh.vtk tangled.vtk out.vtk"),
    ("Converted, and with a page that shows it", "meshfix untangle --report report.html tangled.vtk repaired.vtu"),
    ("As a filter, in a batch job", "meshfix untangle --quiet <tangled.vtk >repaired.vtk"),
)


@click.command(cls=Command, examples=EXAMPLES, short_help="Move interior vertices until no element is inverted.")
@writing
@solving
@morphing
@under(REPORT, "--history", type=HISTORY, metavar="FILE.csv", help="Write a CSV line for each sweep.")
@drawing_cells
@drawing
@allowing
@under(
    REPORT,
    "--verbose",
    "-v",
    is_flag=True,
    help="Print a line for each sweep on stderr as it comes, and a table by types.",
)
@under(
    PROCESS,
    "--keep-best",
    is_flag=True,
    help="Where Ctrl-C, or a batch system, ends it, write the best mesh so far; a second signal ends it without that.",
)
@under(PROCESS, "--mpi", is_flag=True, help="Share the mesh among the processes that mpiexec has started.")
@requiring
@holding
@reporting
def untangle(
    files: Files,
    held: Held,
    show: Show,
    method: Method,
    morph: Morph,
    history: str | None,
    cells: str | None,
    draw: Draw,
    allow_inverted: bool,
    verbose: bool,
    keep_best: bool,
    mpi: bool,
    requirements: tuple[Requirement, ...],
) -> None:
    """Move interior vertices until no element is inverted, then improve the worst angles.

    Strategies: auto (thin layers follow a wall that has left them behind; else Laplacian sweeps, the linear programme
    on stars that are still invalid, then FF where that is not enough), FF (the foldover-free energy, minimised over all
    vertices at once), and the paper's LS (Laplacian), US (linear programme), CS (both for each vertex), LUS (3
    Laplacian sweeps, then the programme).
    """
    from meshfix_cli.meshfile.atomic import write_text
    from meshfix_cli.meshfile.writing import check_cells
    from meshfix_cli.report.as_json import history_csv

    show.check(verbose)
    check_morph(morph, method)
    if mpi and click.get_current_context().get_parameter_source("threads") is ParameterSource.DEFAULT:
        show = replace(show, threads=1)  # the launcher has a process for each core
        click.get_current_context().params["threads"] = 1
    if mpi and keep_best:
        raise click.UsageError("--mpi and --keep-best exclude each other")
    shown = show.live(wanted=True, every_sweep=verbose)
    course = Course(keep_best, files.dry_run, is_streamed(files.target))

    def watch(steps: Steps) -> Steps:
        return shown.follow(course.follow(steps))

    def begin(doing: str) -> None:
        course.begin(doing)
        show_stage(shown, doing, files)

    with processes(method, show.threads, watch) if mpi else nullcontext() as root:
        if root and files.source == "-":
            raise click.UsageError("with --mpi, INPUT is a file: launchers lose what comes from stdin")
        draw.check()
        courses[:] = [course]
        with shown:
            show_stage(shown, READING, files)
            document, output = open_files(files, held, show.threads, history, cells, *draw.names)
            if cells is not None:
                check_cells(document, cells)
            document, before = morph.of(document, held, show.threads)
            alone = partial(method.solve, threads=show.threads, watch=watch)
            solve, put = (root.solve, root.put) if root else (alone, None)
            course.begin(SOLVING, document.mesh.topology.m)
            judge = show.judge(draw, requirements)
            report = course.noted(repair(document, output, files, method, judge, solve, put, before, begin))
            if history is not None:
                write_text(history, history_csv(report.records))
            if cells is not None:
                write_cells(document, report.mesh, cells, show.threads)
            draw.write(report, show.threads)
        show.print(report, report_stream(files), verbose)
        sys.exit(VALID if (report.valid or allow_inverted) and report.met else INVERTED)
