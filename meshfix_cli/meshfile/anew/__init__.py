"""Files that are made of a mesh of another format, by writers of our own: they keep what both formats hold."""

from __future__ import annotations

from importlib import import_module

from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.splice import Points

# For each format the module of this folder whose `written(content, form)` returns its bytes.
WRITERS = {
    "medit": "medit", "gmsh22": "gmsh", "gmsh": "gmsh", "abaqus": "abaqus", "nastran": "nastran", "su2": "su2",
    "vtk": "vtk", "vtk42": "vtk", "vtu": "vtu", "xdmf": "xdmf", "exodus": "exodus",
}  # fmt: skip


def written(source: Source, points: Points, form: Format) -> bytes:
    """Return a file of a format in `WRITERS` with other points (n, d).

    Raises
    ------
    WriteError
        The format has no such elements.
    """
    from meshfix_cli.meshfile.anew.content import Content  # which few runs ask for

    module = import_module(f"{__name__}.{WRITERS[form.name]}")
    data: bytes = module.written(Content.of(source, points), form)
    return data
