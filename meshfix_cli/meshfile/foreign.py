"""Formats that no module of this package reads: what they are called, and what meshio would miss in those it reads.

Source: FreeFEM documentation, "Mesh generation"; "LS-DYNA Keyword User's Manual"; GetFEM user documentation, "Build a
mesh"; SU2 documentation, "Mesh file"; "MSC Nastran Quick Reference Guide".
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.formats import HEAD, Format

MOST_BYTES = 65536  # of a data set that may be texts
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"
# How a file begins, and where its extension must help to tell.
_FOREIGN = (
    ("GetFEM", r"(?:%[^\n]*\n\s*)*(?:% GETFEM MESH|BEGIN POINTS LIST|BEGIN MESH STRUCTURE)", ""),
    ("Ansys Fluent", r"\(\s*\d+\s+[\"(\d]", ""),
    ("LS-DYNA", r"(?:\$[^\n]*\n\s*)*\*(?:KEYWORD|NODE[\s_%](?s:.*)\*ELEMENT_|PART\s|ELEMENT_)", ""),
    ("exotxt", r"! Database Title", ""),
    ("MOVIE.BYU", r"\d+ +\d+ +\d+ +\d+\s*\n\s*\d+ +\d+", ".g"),
    ("FreeFEM", rf"\d+ +\d+ +\d+\s*\n\s*(?:{_NUMBER}\s+){{2,3}}\d+\s*\n", ".msh"),
)


def name_of(data: bytes, suffix: str) -> str | None:
    """Return what a format is called that is not read, though its extension or its first words are those of another."""
    text = data[:HEAD].decode("latin-1").lstrip("\ufeff\xef\xbb\xbf \t\r\n").replace("\r", "\n")
    for name, begin, extension in _FOREIGN:
        if extension in ("", suffix) and re.match(begin, text):
            return name
    return None


def misread(data: bytes, form: Format) -> str | None:
    """Say what meshio would read without a word as something else than it is, and what is not there.

    Several meshes in one file are laid over one another.
    """
    if form.name == "nastran" and re.search(rb"BEGIN BULK", data) and not _BULK.search(data):
        return "is truncated: it ends with BEGIN BULK"
    if form.name == "permas" and b"$FIN" not in data:
        return "is truncated: it does not end with $FIN"
    return _several(data, form)


# A line behind BEGIN BULK that is no comment; meshio looks for one for ever.
_BULK = re.compile(rb"(?s)BEGIN BULK.*?\n(?![$#]|//)[^\n]{3,}\n")


def _several(data: bytes, form: Format) -> str | None:
    """Say that there are several meshes."""
    for what, pattern in _ONCE.get(form.name, ()):
        if len(re.findall(pattern, data)) > 1:
            return f"holds several {what}, and one mesh is read: give each a file of its own"
    return None


# What stands once in a file of one mesh: of several, meshio reads one, or lays them over one another.
_ONCE = {
    "avsucd": [("meshes", rb"(?m)^\s*(?:\d+[ \t]+){4}\d+\s*\n\s*\d+(?:[ \t]+[-+.\d]\S*){3}\s*\n")],
    "nastran": [("bulk data sections", rb"(?mi)^\s*BEGIN\s+(?:BULK|SUPER)\b")],
    "netgen": [("meshes", rb"(?m)^\s*points\s*$")],
    "permas": [("blocks of nodes", rb"(?mi)^\s*\$COOR\b")],
    "su2": [("zones", rb"(?m)^\s*(?:NZONE\s*=\s*(?:[2-9]|1\d)|IZONE\s*=)"), ("zones", rb"(?m)^\s*NPOIN\s*=")],
}


def missing_cells(data: bytes, form: Format, cells: int) -> str | None:
    """Say that a file announces more cells than were read; meshio reads some truncated files without a word."""
    found = re.search(rb"NELEM\s*=\s*(\d+)", data) if form.name == "su2" else None
    if found and cells < int(found[1]):
        return f"is truncated: it announces {int(found[1]):,} cells and holds {cells:,}"
    return None


def numbers(data: bytes, form: Format) -> dict[str, NDArray[np.int64]]:
    """Return for each type of cells the numbers of its cells: the file's own, or positions among all, from 0.

    meshio groups cells by type; empty where its order tells all that there is.
    """
    if form.name == "su2":
        begin = re.search(rb"(?m)^\s*NELEM\s*=\s*(\d+)[^\n]*\n", data)
        lines = data[begin.end() :].split(b"\n", int(begin[1]))[: int(begin[1])] if begin else []
        kinds = [_SU2.get(line.split(None, 1)[0], "") for line in lines if line.strip()]
        return _by_kind(kinds, np.arange(len(kinds)))
    if form.name not in ("nastran", "avsucd"):
        return {}
    pattern, names = (_CARD, _NASTRAN) if form.name == "nastran" else (_LINE, _UCD_TYPES)
    found = [(one["kind"], int(one["id"])) for one in pattern.finditer(data)]
    return _by_kind(
        [names.get(kind, "") for kind, _ in found], np.array([number for _, number in found], dtype=np.int64)
    )


def _by_kind(kinds: list[str], ids: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    order = np.array(kinds)
    return {kind: ids[order == kind] for kind in dict.fromkeys(kinds) if kind}


_CARD = re.compile(rb"(?m)^(?P<kind>C(?:BAR|ROD|TRI|QUA|TET|PYR|PEN|HEX)[A-Z]*\d*)\*?[ \t,]+(?P<id>\d+)")
_LINE = re.compile(rb"(?m)^\s*(?P<id>\d+)\s+-?\d+\s+(?P<kind>[a-z]+)\s")
_SU2 = {
    b"3": "line", b"5": "triangle", b"9": "quad", b"10": "tetra", b"12": "hexahedron", b"13": "wedge", b"14": "pyramid",
}  # fmt: skip
_NASTRAN = {
    b"CBAR": "line", b"CROD": "line", b"CTRIA3": "triangle", b"CTRIAR": "triangle", b"CQUAD4": "quad",
    b"CQUADR": "quad", b"CTETRA": "tetra", b"CPYRA": "pyramid", b"CPYRAM": "pyramid", b"CPENTA": "wedge",
    b"CHEXA": "hexahedron",
}  # fmt: skip
_UCD_TYPES = {
    b"line": "line", b"tri": "triangle", b"quad": "quad", b"tet": "tetra", b"pyr": "pyramid", b"prism": "wedge",
    b"hex": "hexahedron",
}  # fmt: skip


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
