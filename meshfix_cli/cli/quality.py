"""`meshfix quality`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from meshfix_cli.cli.files import check_input, check_others, given, is_large, write_cells
from meshfix_cli.cli.help import REPORT, Command, under
from meshfix_cli.cli.names import FILE
from meshfix_cli.cli.options import Draw, Show, drawing, drawing_cells, holding, reporting, requiring
from meshfix_cli.cli.process import ERROR, INVERTED, SOME_FAILED, VALID, complain
from meshfix_cli.errors import MeshfixError
from meshfix_cli.repair import Held, as_surface

if TYPE_CHECKING:
    from meshfix_cli.quality.requirement import Requirement


EXAMPLES = (
    ("What is wrong, and where", "meshfix quality tangled.vtk"),
    ("Several meshes, for a program", "meshfix quality --json mesh.vtk tangled.vtk"),
    ("Fail where an angle is small", "meshfix quality --quiet --require 'min_angle >= 20' mesh.vtk"),
    ("The groups of a file, and the aspect ratio", "meshfix quality --verbose --metric aspect_ratio mesh.vtk"),
)


@click.command(
    cls=Command, examples=EXAMPLES, short_help="Report the quality of meshes, and where elements are inverted."
)
@click.argument("sources", metavar="INPUT...", nargs=-1, required=True, type=FILE)
@drawing_cells
@drawing
@under(REPORT, "--all", "everything", is_flag=True, help="List every inverted element, not the first ten.")
@under(REPORT, "--verbose", "-v", is_flag=True, help="List the groups and sets of the file, and what they hold.")
@requiring
@holding
@reporting
def quality(
    sources: tuple[str, ...],
    cells: str | None,
    draw: Draw,
    everything: bool,
    verbose: bool,
    requirements: tuple[Requirement, ...],
    held: Held,
    show: Show,
) -> None:
    """Report the quality of meshes, and where elements are inverted. One unreadable mesh does not stop the others."""
    beside = given(cells, *draw.names)
    if beside and len(sources) > 1:
        raise click.UsageError("--cells, --report, --report-json and --plot take one INPUT")
    draw.check()
    show.check(verbose)
    codes = set()
    for source in sources:
        try:
            with show.live(wanted=is_large(source)) as shown:
                shown.show(f"reading {source}")
                check_input(source)
                check_others(beside, source)
                document = as_surface(held.read(source, show.threads))
                check_others(beside, *document.files)
                shown.show("measuring the quality")
                if cells is not None:
                    write_cells(document, document.mesh, cells, show.threads)
                stages = {"mesh": document.mesh}
                groups = document.groups() if verbose or show.as_json or draw.json else None
                judge = show.judge(draw, requirements)
                report = judge.report("quality", document, stages, everything=everything, groups=groups)
                draw.write(report, show.threads)
        except MeshfixError as error:
            complain(str(error))
            codes.add(ERROR)
            continue
        show.print(report, sys.stdout, by_type=True)
        codes.add(VALID if report.valid and report.met else INVERTED)
    sys.exit(max(codes) if ERROR not in codes else SOME_FAILED if len(sources) > 1 else ERROR)
