"""The command line: click, and nothing else. A command is imported when it runs, and imports what is heavy itself."""

from __future__ import annotations

import click

from meshfix_cli import __version__
from meshfix_cli.cli.process import Commands, Group, cores


def _print_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if not wanted or ctx.resilient_parsing:
        return
    import platform
    from importlib.metadata import version

    from meshfix_cli.kernels import BUILD

    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "meshio"))
    threads = f"{cores()} thread{'s' * (cores() > 1)}"
    python = f"Python {platform.python_version()}, {libraries}"
    click.echo(f"meshfix {__version__} (kernels for {BUILD}, {threads}; {python})")
    ctx.exit()


EXAMPLES = (
    ("What is wrong with a mesh", "meshfix quality tangled.vtk"),
    ("Mend it", "meshfix untangle tangled.vtk repaired.vtk"),
    ("Complete options and files in bash", 'eval "$(_MESHFIX_COMPLETE=bash_source meshfix)"'),
)


@click.group(
    cls=Group,
    commands=Commands(),
    examples=EXAMPLES,
    short_help="Repair tangled meshes.",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Show the version, and what it runs with.",
)
def main() -> None:
    """Repair tangled meshes by moving vertices: solids, plane meshes and surfaces, of straight or curved elements.

    INPUT and OUTPUT are files, of more than 40 formats and also in .gz, or - for stdin and stdout; a .pvtu stands for
    its pieces, and 'mesh_*.msh', in quotes, for the parts of a mesh. Exit codes: 0 the mesh is valid, 1 an error
    (OUTPUT, or a file beside it, was not written), 2 wrong usage, 3 inverted elements remain, the fixed boundary
    crosses itself or a --require is not met, 4 some of several meshes cannot be read or, in a batch, are not valid.
    """
