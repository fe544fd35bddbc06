"""VTK's XML files that name the pieces of an unstructured grid, .pvtu.

Source: VTK documentation, "VTK File Formats", section XML Formats, parallel file formats.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.sax.saxutils import escape

from meshfix_cli.errors import ReadError, WriteError, naming
from meshfix_cli.meshfile import formats
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.vtk import vtu
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile

# XML holds no control characters, and of a name of a file only what is text.
_NOT_XML = re.compile("[\x00-\x1f\ud800-\udfff\ufffe\uffff]")


@dataclass(frozen=True, eq=False)
class Index:
    """A file that names pieces, in the order of which points and cells are numbered.

    Attributes
    ----------
    path : Path
    file : XmlFile
    pieces : sequence of Element
    """

    path: Path
    file: XmlFile
    pieces: Sequence[Element]

    form = Format("pvtu")
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
        if path is None:
            raise ReadError("names pieces that are beside it, so it is read from its file and not from a stream")
        file = XmlFile.parse(data)
        pieces = file.root.named("PUnstructuredGrid", "Piece")
        if not pieces:
            raise ReadError("is not a readable pvtu file: it names no pieces of an unstructured grid")
        index = cls(path, file, pieces)
        seen: set[Path] = set()
        for name, piece in zip(index.names, index.paths, strict=True):
            if not name:
                raise ReadError("is not a readable pvtu file: a piece has no Source")
            if piece.resolve() in seen:
                raise ReadError(f"{name}: stands twice among the pieces")
            seen.add(piece.resolve())
        return index

    @property
    def names(self) -> list[str]:
        """The pieces as the file names them."""
        return [piece.attributes.get("Source", "").strip() for piece in self.pieces]

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
                if form is None or form.name != "vtu":
                    raise ReadError("is a piece, and not a .vtu file of an unstructured grid")
                sources.append(vtu.parse(data))
        return sources

    def promoted(self, contents: Sequence[bytes]) -> tuple[Index, list[bytes]]:
        """Return the pieces with coordinates in float64, and the index that says so."""
        arrays = self.file.root.named("PUnstructuredGrid", "PPoints", "PDataArray")
        edits = [self.file.attribute(array, "type", "Float64") for array in arrays if array.kind == "f4"]
        file = XmlFile.parse(self.file.edited(edits))
        index = replace(self, file=file, pieces=file.root.named("PUnstructuredGrid", "Piece"))
        return index, [vtu.promoted(data) for data in contents]

    def targets(self, target: str) -> list[str]:
        """Return where the pieces of an output go.

        In place they are replaced; else their names are OUTPUT's without its extension, and the number of the piece.
        """
        there = Path(target)
        if there.exists() and there.samefile(self.path):
            return [str(path) for path in self.paths]
        if _NOT_XML.search(there.stem):
            raise WriteError(f"{target}: its name holds what XML cannot, in which a .pvtu names its pieces")
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
        edits = [self.file.attribute(piece, "Source", _quoted(new)) for piece, old, new in changed if old != new]
        return [(target, self.file.edited(edits))]

    def _names_for(self, there: Path) -> list[str]:
        return [f"{there.stem}_{i}.vtu" for i in range(len(self.pieces))]


def _quoted(name: str) -> str:
    return escape(name, {'"': "&quot;", "'": "&apos;"})
