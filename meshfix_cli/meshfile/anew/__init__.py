"""Files that are made of a mesh of another format, by writers of our own: they keep what both formats hold."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from meshfix_cli.meshfile.numbering import numbered
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.splice import Points

# For each format the module of this folder whose `written(content, form)` returns its bytes; where the format has
# numbers of nodes and elements, also `HELD`, the types of cells that it writes, and `MOST`, the largest number.
WRITERS = {
    "medit": "medit", "gmsh22": "gmsh", "gmsh": "gmsh", "abaqus": "abaqus", "nastran": "nastran", "su2": "su2",
    "vtk": "vtk", "vtk42": "vtk", "vtu": "vtu", "xdmf": "xdmf", "exodus": "exodus",
}  # fmt: skip


def prepared(source: Source, form: Format) -> Source:
    """Return what is to be written in a format in `WRITERS`: with the numbers of nodes and elements that it will have.

    Parameters
    ----------
    source : Source
        With one run for each type.
    """
    module = _module(form)
    return numbered(source, module.HELD, module.MOST) if hasattr(module, "MOST") else source


def written(source: Source, points: Points, form: Format) -> bytes:
    """Return a file of a format in `WRITERS` with other points (n, d), of what `prepared` gives.

    Raises
    ------
    WriteError
        The format has no such elements.
    """
    from meshfix_cli.meshfile.anew.content import Content  # which few runs ask for

    data: bytes = _module(form).written(Content.of(source, points), form)
    return data


def _module(form: Format) -> Any:
    """Imported when a file needs it."""
    return import_module(f"{__name__}.{WRITERS[form.name]}")
