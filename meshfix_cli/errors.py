"""What can go wrong, in one sentence each.

MeshfixError
├── InvalidMeshError    the arrays are not a triangle or tetrahedral mesh that can be worked on
├── OptionError         an option has a value that it cannot have
├── ReadError           the file cannot be read, or holds no such mesh
├── RequirementError    what is required of a mesh cannot be judged
└── WriteError          the result cannot be written
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

MOST_NAMED = 20  # of things that are listed in one sentence


class MeshfixError(Exception):
    """Base of all errors; its text is one clear line for the user."""


class InvalidMeshError(MeshfixError):
    """The arrays are not a triangle or tetrahedral mesh that can be worked on."""


class OptionError(MeshfixError, ValueError):
    """An option has a value that it cannot have."""


class ReadError(MeshfixError):
    """The file cannot be read, or holds no triangle or tetrahedral mesh."""


class RequirementError(MeshfixError):
    """What is required of a mesh cannot be judged."""


class WriteError(MeshfixError):
    """The result cannot be written; nothing was."""


def on_one_line(error: object) -> str:
    """Return on one line what another library says of an error."""
    return " ".join(str(error).split())


def listed(names: Sequence[str]) -> str:
    """Name the first of some things, and how many more there are."""
    more = f" and {len(names) - MOST_NAMED:,} more" * (len(names) > MOST_NAMED)
    return ", ".join(names[:MOST_NAMED]) + more


def together(names: Sequence[str]) -> str:
    """Name all of some things: "a", "a and b", "a, b and c"."""
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Let errors begin with the name of the file that they are about."""
    try:
        yield
    except MeshfixError as error:
        raise type(error)(f"{name}: {error}") from error
