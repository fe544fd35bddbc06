"""Formats that no module of this package reads: what they are called, and what meshio would miss in those it reads."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any

from meshfix_cli.meshfile.formats import HEAD
from meshfix_cli.meshfile.recognise import Format

MOST_BYTES = 65536  # of a data set that may be texts
# How a file begins.
_FOREIGN = (
    ("STEP", r"ISO-10303-21;"),
    ("OpenCASCADE", r"(?:DBRep_DrawableShape|CASCADE Topology V)"),
    ("EnSight", r"(?:#[^\n]*\n\s*)*FORMAT\s*\n\s*type:\s*ensight"),
    ("glTF", r"glTF"),
)


def name_of(data: bytes) -> str | None:
    """Return what a format is called that is not read, though its extension or its first words are those of another."""
    text = data[:HEAD].decode("latin-1").lstrip("\ufeff\xef\xbb\xbf \t\r\n").replace("\r", "\n")
    return next((name for name, begin in _FOREIGN if re.match(begin, text)), None)


def misread(data: bytes, form: Format) -> str | None:
    """Say what meshio would read without a word as something else than it is, and what is not there.

    Several meshes in one file are laid over one another.
    """
    if form.name == "permas" and b"$FIN" not in data:
        return "is truncated: it does not end with $FIN"
    return _several(data, form)


def _several(data: bytes, form: Format) -> str | None:
    """Say that there are several meshes."""
    what, pattern = _ONCE.get(form.name, ("", b"(?!)"))
    several = len(re.findall(pattern, data)) > 1
    return f"holds several {what}, and one mesh is read: give each a file of its own" if several else None


# What stands once in a file of one mesh: of several, meshio reads one, or lays them over one another.
_ONCE = {
    "permas": ("blocks of nodes", rb"(?mi)^\s*\$COOR\b"),
}


def words_lost(before: bytes, after: bytes) -> list[str]:
    """Return the words and names of a file that another, written of it, does not have.

    Comments do not count. Of binary files those of HDF5 have names.
    """
    kept = {word.upper() for word in _words(after)}
    return [word for word in dict.fromkeys(_words(before)) if word.upper() not in kept]


def _words(data: bytes) -> Iterator[str]:
    if data.startswith(b"\x89HDF"):
        yield from _names_in_hdf5(data)
    elif b"\0" not in data:
        for word in re.findall(rb"[A-Za-z_][\w.-]*", _COMMENT.sub(b"", data)):
            if not re.fullmatch(rb"[eEdD][-+]?\d*", word):  # of a number
                yield word.decode("latin-1")


def _names_in_hdf5(data: bytes) -> Iterator[str]:
    """Give the names of groups and data sets, and the texts in small ones: names are often there."""
    import h5py

    names: list[str] = []

    def visit(name: str, item: Any) -> None:
        names.append(name.rpartition("/")[2])
        if (
            isinstance(item, h5py.Dataset)
            and item.dtype.kind in "SOi"
            and item.dtype.itemsize < 2
            and item.size < 65536
        ):
            names.extend(re.findall(r"[A-Za-z_][\w .-]+", item[()].tobytes().decode("latin-1")))

    with h5py.File(io.BytesIO(data)) as file:
        file.visititems(visit)
    yield from names


_COMMENT = re.compile(rb"(?m)(?:^\s*[$%#]|//)[^\n]*")
