"""VTK's XML files that name the pieces of an unstructured grid, .pvtu, or of polydata, .pvtp.

Source: VTK documentation, "VTK File Formats", section XML Formats, parallel file formats.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import escape

from meshfix_cli.errors import ReadError, WriteError, naming
from meshfix_cli.meshfile import formats
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.vtk import vtp, vts, vtu
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile

# XML holds no control characters, and of a name of a file only what is text.
_NOT_XML = re.compile("[\x00-\x1f\ud800-\udfff\ufffe\uffff]")


MODULES: Mapping[str, Any] = {"vtu": vtu, "vtp": vtp, "vts": vts}  # by the formats of pieces


class Kind(NamedTuple):
    """A type of such files: its format, that of its pieces, and what these hold, in words."""

    form: str
    pieces: str
    words: str


_KINDS = {
    "PUnstructuredGrid": Kind("pvtu", "vtu", "an unstructured grid"),
    "PPolyData": Kind("pvtp", "vtp", "polydata"),
}


@dataclass(frozen=True, eq=False)
class Index:
    """A file that names pieces, in the order of which points and cells are numbered.

    Attributes
    ----------
    path : Path
    file : XmlFile
    pieces : sequence of Element
    kind : Kind
    """

    path: Path
    file: XmlFile
    pieces: Sequence[Element]
    kind: Kind

    attribute = "Source"  # that has the name of a piece
    numbers = "global ids"
    by_position = True

    @classmethod
    def of(cls, data: bytes, path: Path | None) -> Index:
        """Read which pieces there are; None: there is no file beside which they could be.

        Raises
        ------
        ReadError
            There are none, or one stands twice in it.
        """
        file, there = read_index(data, path)
        found = [(kind, file.root.named(tag, "Piece")) for tag, kind in _KINDS.items() if file.root.named(tag)]
        kind, pieces = found[0] if found else (_KINDS["PUnstructuredGrid"], [])
        if not pieces:
            raise ReadError(f"is not a readable {kind.form} file: it names no pieces of {kind.words}")
        return cls(there, file, pieces, kind).checked()

    def checked(self) -> Index:
        """Return the same; ReadError where a piece has no name, or stands twice in it."""
        seen: set[Path] = set()
        for name, piece in zip(self.names, self.paths, strict=True):
            if not name:
                raise ReadError(f"is not a readable {self.kind.form} file: a piece has no {self.attribute}")
            if piece.resolve() in seen:
                raise ReadError(f"{name}: stands twice among the pieces")
            seen.add(piece.resolve())
        return self

    @property
    def form(self) -> Format:
        """The format of all files together."""
        return Format(self.kind.form)

    @property
    def names(self) -> list[str]:
        """The pieces as the file names them."""
        return [piece.attributes.get(self.attribute, "").strip() for piece in self.pieces]

    @property
    def paths(self) -> list[Path]:
        """Where the pieces are."""
        return [self.path.parent / name for name in self.names]

    def parse(self, contents: Sequence[bytes]) -> list[Source]:
        """Read the pieces."""
        sources = []
        for name, data in zip(self.names, contents, strict=True):
            with naming(name):
                form = formats.sniff(data)
                if form is None or form.name not in self.kind.pieces.split():
                    raise ReadError(self._unlike())
                sources.append(MODULES[form.name].parse(data))
        return sources

    def _unlike(self) -> str:
        return f"is a piece, and not a .{self.kind.pieces} file of {self.kind.words}"

    def promoted(self, contents: Sequence[bytes]) -> tuple[Index, list[bytes]]:
        """Return the pieces with coordinates in float64, and the index that says so."""
        arrays = [array for tag in _KINDS for array in self.file.root.named(tag, "PPoints", "PDataArray")]
        edits = [self.file.attribute(array, "type", "Float64") for array in arrays if array.kind == "f4"]
        file = XmlFile.parse(self.file.edited(edits))
        index = replace(self, file=file, pieces=self.pieces_in(file))
        return index, [MODULES[self._form_of(data)].promoted(data) for data in contents]

    def pieces_in(self, file: XmlFile) -> list[Element]:
        """Return what stands for the pieces in such a file."""
        return [piece for tag in _KINDS for piece in file.root.named(tag, "Piece")]

    def _form_of(self, data: bytes) -> str:
        form = formats.sniff(data)
        return form.name if form else ""

    def targets(self, target: str) -> list[str]:
        """Return where the pieces of an output go.

        In place they are replaced; else their names are OUTPUT's without its extension, and the number of the piece.
        """
        there = Path(target)
        if there.exists() and there.samefile(self.path):
            return [str(path) for path in self.paths]
        if _NOT_XML.search(there.stem):
            raise WriteError(f"{target}: its name holds what XML cannot, in which a .{self.kind.form} names its pieces")
        targets = [there.parent / name for name in self._names_for(there)]
        mine = {path.resolve() for path in (*self.paths, self.path)}
        for piece in targets:
            if piece.resolve() in mine:
                raise WriteError(f"{target}: {piece.name} would replace a piece of the input; name another OUTPUT")
        return [str(piece) for piece in targets]

    def beside(self, target: str, targets: Sequence[str]) -> list[tuple[str, bytes]]:
        """Return the name and the content of the new index."""
        there = Path(target)
        if there.exists() and there.samefile(self.path):
            return [(target, self.file.data)]
        names = self._names_for(there)
        changed = zip(self.pieces, self.names, names, strict=True)
        edits = [self.file.attribute(piece, self.attribute, _quoted(new)) for piece, old, new in changed if old != new]
        return [(target, self.file.edited(edits))]

    def _names_for(self, there: Path) -> list[str]:
        suffixes = [Path(name).suffix or ".vtu" for name in self.names]
        return [f"{there.stem}_{i}{suffix}" for i, suffix in enumerate(suffixes)]


def read_index(data: bytes, path: Path | None) -> tuple[XmlFile, Path]:
    """Return such a file, and where it is; None: there is no file beside which pieces could be."""
    if path is None:
        raise ReadError("names pieces that are beside it, so it is read from its file and not from a stream")
    return XmlFile.parse(data), path


def _quoted(name: str) -> str:
    return escape(name, {'"': "&quot;", "'": "&apos;"})
