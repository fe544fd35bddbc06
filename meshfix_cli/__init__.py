"""Repairs tangled meshes by moving interior vertices.

>>> from meshfix_cli import read, untangle, write
>>> document = read("tangled.vtk")
>>> outcome = untangle(document.mesh)
>>> write(document, outcome.after, "valid.vtk")
"""

# Nothing is imported here: it would be before `__main__` can make an early signal end the process without a word.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.meshfile.document import Document
    from meshfix_cli.meshfile.reading import read
    from meshfix_cli.meshfile.writing import write
    from meshfix_cli.quality.summary import summarise
    from meshfix_cli.solve.perturb import perturb
    from meshfix_cli.solve.untangle import untangle

__version__ = "0.1.0"

__all__ = ["Document", "Mesh", "perturb", "read", "summarise", "untangle", "write"]

# Where the names are at home; a module is imported when one of its names is asked for.
_HOME = {
    "Document": "meshfile.document",
    "Mesh": "mesh.mesh",
    "perturb": "solve.perturb",
    "read": "meshfile.reading",
    "summarise": "quality.summary",
    "untangle": "solve.untangle",
    "write": "meshfile.writing",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
