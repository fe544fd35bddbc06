"""`meshfix perturb`."""

from __future__ import annotations

from dataclasses import replace

import click

from meshfix_cli.cli.course import JUDGING, READING, WRITING
from meshfix_cli.cli.files import is_large, open_files, report_stream, show_stage
from meshfix_cli.cli.help import FREEDOM, METHOD, Command, under
from meshfix_cli.cli.options import LENGTH, PERCENT, Draw, Show, drawing, holding, reporting, sliding, writing
from meshfix_cli.repair import Files, Held, Method
from meshfix_cli.solve.perturb import Distance, tangled
from meshfix_cli.solve.strategies import RANGES

EXAMPLES = (
    ("As the paper does", "meshfix perturb --percent 25 --dist 2h mesh.vtk tangled.vtk"),
    ("And mend it", "meshfix perturb --percent 5 --dist h mesh.vtk | meshfix untangle >out.vtk"),
)


@click.command(cls=Command, examples=EXAMPLES, short_help="Tangle a mesh: move some interior vertices at random.")
@writing
@under(METHOD, "--percent", type=PERCENT, required=True, help="Of all vertices; interior ones move.")
@under(METHOD, "--dist", type=LENGTH, required=True, help="2h: two mean edge lengths; 0.3: model units.")
@under(FREEDOM, "--boundary", is_flag=True, help="The same as --slide flat.")
@sliding
@under(METHOD, "--seed", type=click.IntRange(*RANGES["seed"]), default=0, show_default=True)
@drawing
@holding
@reporting
def perturb(
    files: Files,
    held: Held,
    show: Show,
    draw: Draw,
    method: Method,
    percent: float,
    dist: Distance,
    boundary: bool,
    seed: int,
) -> None:
    """Tangle a mesh as the paper does: move some interior vertices by a distance in random directions.

    With --slide, vertices of the boundary move as well, each in its plane, on its surface or along its edge.

    With one seed, the same vertices move in the same directions whatever --percent and --dist are. Exits with 0
    whether or not elements are inverted.
    """
    draw.check()
    if boundary and method.slide == "none":
        method = replace(method, slide="flat")
    with show.live(wanted=is_large(files.source)) as shown:
        show_stage(shown, READING, files)
        document, output = open_files(files, held, show.threads, *draw.names)
        document = method.freed(document)
        perturbed, facts = tangled(document.mesh, percent, dist, seed, show.threads)
        show_stage(shown, WRITING, files)
        result, notes = files.write(document, perturbed, output)
        show_stage(shown, JUDGING, files)
        stages = {"before": document.mesh, "perturbed": result}
        notes = (*method.without_effect(document.mesh), *notes)
        report = show.judge(draw).report("perturb", document, stages, notes, facts=facts)
        draw.write(report, show.threads)
    show.print(report, report_stream(files))
