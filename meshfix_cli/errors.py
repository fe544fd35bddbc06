"""What can go wrong, in one sentence each.

MeshfixError
├── InvalidMeshError    the arrays are not a triangle or tetrahedral mesh that can be worked on
├── ReadError           the file cannot be read, or holds no such mesh
├── RequirementError    what is required of a mesh cannot be judged
└── WriteError          the result cannot be written
"""

from collections.abc import Iterator
from contextlib import contextmanager


class MeshfixError(Exception):
    """Base of all errors; its text is one clear line for the user."""


class InvalidMeshError(MeshfixError):
    """The arrays are not a triangle or tetrahedral mesh that can be worked on."""


class ReadError(MeshfixError):
    """The file cannot be read, or holds no triangle or tetrahedral mesh."""


class RequirementError(MeshfixError):
    """What is required of a mesh cannot be judged."""


class WriteError(MeshfixError):
    """The result cannot be written; nothing was."""


def on_one_line(error: object) -> str:
    """Return on one line what another library says of an error."""
    return " ".join(str(error).split())


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Let errors begin with the name of the file that they are about."""
    try:
        yield
    except MeshfixError as error:
        raise type(error)(f"{name}: {error}") from error
