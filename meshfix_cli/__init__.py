"""Repairs tangled meshes by moving interior vertices.

>>> from meshfix_cli import read, untangle, write
>>> document = read("tangled.vtk")
>>> outcome = untangle(document.mesh)
>>> write(document, outcome.after, "valid.vtk")
"""

# Nothing is imported here: it would be before `__main__` can make an early signal end the process without a word.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from meshfix_cli.errors import InvalidMeshError, MeshfixError, OptionError, ReadError, RequirementError, WriteError
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.meshfile.document import Document
    from meshfix_cli.meshfile.reading import read
    from meshfix_cli.meshfile.writing import write
    from meshfix_cli.objects.api import Repairer, Result, perturb, quality, untangle
    from meshfix_cli.quality.summary import summarise

__version__ = "0.2.0"

__all__ = [
    "Document",
    "InvalidMeshError",
    "Mesh",
    "MeshfixError",
    "OptionError",
    "ReadError",
    "Repairer",
    "RequirementError",
    "Result",
    "WriteError",
    "perturb",
    "quality",
    "read",
    "summarise",
    "untangle",
    "write",
]

# Where the names are at home; a module is imported when one of its names is asked for.
_HOME = {
    "Document": "meshfile.document",
    "Mesh": "mesh.mesh",
    **dict.fromkeys(("Repairer", "Result", "perturb", "quality", "untangle"), "objects.api"),
    **dict.fromkeys([name for name in __all__ if name.endswith("Error")], "errors"),
    "read": "meshfile.reading",
    "summarise": "quality.summary",
    "write": "meshfile.writing",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:  # what completes a name in Python
    return sorted({*globals(), *__all__})
