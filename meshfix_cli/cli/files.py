"""Which files a command reads and writes, checked before any work."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from meshfix_cli.cli.course import JUDGING, READING, WRITING
from meshfix_cli.cli.process import closed
from meshfix_cli.errors import WriteError

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.meshfile.document import Document
    from meshfix_cli.meshfile.recognise import Format
    from meshfix_cli.repair import Files, Held
    from meshfix_cli.report.terminal import Shown


LARGE = 16e6  # bytes: what is smaller is read in a moment


def check_input(source: str) -> None:
    """Refuse to read from a terminal."""
    if source == "-" and sys.stdin.isatty():
        raise click.UsageError("there is no INPUT, and stdin is a terminal")


def open_files(files: Files, held: Held, threads: int, *others: str | None) -> tuple[Document, Format]:
    """Read INPUT, and find out before any work whether OUTPUT and other files can be written."""
    beside = given(*others)
    check_others(beside, files.source, files.target)
    check_input(files.source)
    if files.target == "-" and "stdout" in closed and not files.dry_run:
        raise WriteError("<stdout>: is closed, and the mesh goes there; name an OUTPUT")
    if files.target == "-" and sys.stdout.isatty() and not (files.dry_run or _is_named("target", "output")):
        raise click.UsageError("there is no OUTPUT, and stdout is a terminal; name a file, or - for the terminal")
    document, output = files.open(held, threads)
    written = (files.target,) if files.dry_run else document.outputs(files.target, output)
    check_others(beside, *document.files, *written)
    if files.backup:
        _check_backups(beside, written)
    binary = output.binary or document.source.packed is not None
    on_stdout = files.target == "-" or _is_stdout(files.target)
    if binary and on_stdout and sys.stdout.isatty() and not files.dry_run:
        raise click.UsageError("binary data is not written to a terminal; name an OUTPUT")
    return document, output


def _is_named(*parameters: str) -> bool:
    """Whether the user has given one of these."""
    context = click.get_current_context()
    return any(context.get_parameter_source(name) is ParameterSource.COMMANDLINE for name in parameters)


def is_large(source: str) -> bool:
    """Whether it takes a while to read a file."""
    try:
        return Path(source).stat().st_size >= LARGE
    except OSError:
        return False


def show_stage(shown: Shown, doing: str, files: Files) -> None:
    """Show what is done, where that takes a while; what goes to a stream may go to the terminal."""
    if doing == READING and is_large(files.source):
        shown.show(f"reading {files.source}")
    elif doing == WRITING and (files.dry_run or is_streamed(files.target)):
        shown.hide()
    elif doing == WRITING:
        shown.show(f"writing {files.target}")
    elif doing == JUDGING:
        shown.show("measuring the quality")


def report_stream(files: Files) -> Any:
    """Return stdout, or stderr where the mesh goes to stdout, or to a pipe or device that stdout may be."""
    return sys.stderr if is_streamed(files.target) and not files.dry_run else sys.stdout


def is_streamed(target: str) -> bool:
    """Whether the mesh goes to stdout, a pipe or a device."""
    from meshfix_cli.meshfile.atomic import is_stream

    return is_stream(target) and not Path(target).is_dir()  # which a case of OpenFOAM is


def given(*names: str | None) -> list[str]:
    """Leave out what is not given."""
    return [name for name in names if name is not None]


def check_others(names: list[str], *meshes: str) -> None:
    """Find out whether files beside the mesh can be written, see `check_other`."""
    for i, name in enumerate(names):
        check_other(name, *meshes, *names[:i])


def _check_backups(names: list[str], written: tuple[str, ...]) -> None:
    backups = tuple(f"{Path(one).resolve().name}.bak" for one in written)
    for name in names:
        if Path(name).resolve().name.startswith(backups):
            raise click.UsageError(f"{name} may be the name of the backup")


def check_other(name: str, *meshes: str) -> None:
    """Find out whether a file beside the mesh can be written; it must not replace one."""
    from meshfix_cli.meshfile.atomic import check_target

    if name == "-" or _is_stdout(name):
        raise click.UsageError("only the mesh can go to stdout; name a file")
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


def write_cells(document: Document, mesh: Mesh, target: str, threads: int) -> None:
    """Write what `--cells` asks for."""
    from meshfix_cli.meshfile import writing
    from meshfix_cli.quality.summary import by_element, distances

    cell = {**by_element(mesh, threads), "element": document.ids}
    point = {} if mesh is document.mesh else {"distance_moved": distances(document.mesh, mesh)}
    writing.write_cells(document, mesh, target, cell, point)
