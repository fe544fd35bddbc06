"""Repairs tangled triangle and tetrahedral meshes by moving interior vertices.

>>> from meshfix_cli import read, untangle, write
>>> document = read("tangled.vtk")
>>> outcome = untangle(document.mesh)
>>> write(document, outcome.after, "valid.vtk")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

# The two functions are named as their modules are, which import nothing heavy.
from meshfix_cli.perturb import perturb
from meshfix_cli.untangle import untangle

if TYPE_CHECKING:
    from meshfix_cli.mesh import Mesh
    from meshfix_cli.meshfile import Document, read, write
    from meshfix_cli.quality import summarise

__version__ = "0.1.0"

__all__ = ["Document", "Mesh", "perturb", "read", "summarise", "untangle", "write"]

_HOME = {"Document": "meshfile", "Mesh": "mesh", "read": "meshfile", "summarise": "quality", "write": "meshfile"}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
