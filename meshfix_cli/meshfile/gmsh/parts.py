"""Files of gmsh that are the parts of a mesh, named by a pattern such as `mesh_*.msh`.

Source: "Gmsh Reference Manual", option Mesh.PartitionSplitMeshFiles.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from meshfix_cli.errors import ReadError, WriteError
from meshfix_cli.meshfile import formats, gmsh
from meshfix_cli.meshfile.formats import PARTS
from meshfix_cli.meshfile.source import Source


@dataclass(frozen=True, eq=False)
class Parts:
    """The files that a pattern names, in the order of the numbers in their names.

    Attributes
    ----------
    pattern : Path
    texts : sequence of str
        What the `*` stands for.
    """

    pattern: Path
    texts: Sequence[str]

    form = PARTS
    numbers = "the numbers of nodes"
    by_position = False

    @classmethod
    def of(cls, name: str) -> Parts:
        """Look for files.

        Raises
        ------
        ReadError
            There are none.
        """
        pattern = Path(name)
        if name.count("*") != 1 or "*" not in pattern.name:
            raise ReadError("one * in the name of the file, and no other, stands for what tells parts apart")
        before, after = pattern.name.split("*")
        expected = re.compile(f"{re.escape(before)}(?P<text>.*){re.escape(after)}", re.DOTALL)
        try:
            files = [path.name for path in pattern.parent.iterdir() if path.is_file()]
        except OSError as error:
            raise ReadError(error.strerror or str(error)) from error
        found = [match["text"] for match in map(expected.fullmatch, files) if match]
        texts = sorted((text for text in found if before or not text.startswith(".")), key=_in_order)
        if not texts:
            raise ReadError("there is no file of such a name")
        return cls(pattern, texts)

    @property
    def paths(self) -> list[Path]:
        """Where the parts are."""
        return self._with_texts(self.pattern)

    @property
    def names(self) -> list[str]:
        """The parts without their folder."""
        return [path.name for path in self.paths]

    def parse(self, contents: Sequence[bytes]) -> list[Source]:
        """Read the parts."""
        parts = list(zip(self.names, contents, strict=True))
        for name, data in parts:
            form = formats.sniff(data)
            if form is None or form.reader != "gmsh":
                raise ReadError(f"{name}: is not a file of gmsh, and only those are read by a * in their names")
        return gmsh.parse_parts(parts)

    def promoted(self, contents: Sequence[bytes]) -> tuple[Parts, list[bytes]]:
        """Return the parts: their coordinates are in float64."""
        return self, list(contents)

    def targets(self, target: str) -> list[str]:
        """Return where the parts of an output go: under the same texts, in the place of its `*`."""
        there = Path(target)
        if there.name.count("*") != 1 or "*" in str(there.parent):
            raise WriteError(f"{target}: parts are written as parts: OUTPUT needs one * in its name, or a --format")
        targets = self._with_texts(there)
        mine = {path.resolve() for path in self.paths}
        for part in targets:
            if part.resolve() in mine and not self._is(there):
                raise WriteError(f"{target}: {part.name} would replace a part of the input; name another OUTPUT")
        return [str(part) for part in targets]

    def beside(self, target: str, targets: Sequence[str]) -> list[tuple[str, bytes]]:
        """Return nothing: the parts are all that there is."""
        del target, targets
        return []

    def _is(self, there: Path) -> bool:
        return there.name == self.pattern.name and there.parent.resolve() == self.pattern.parent.resolve()

    def _with_texts(self, pattern: Path) -> list[Path]:
        before, after = pattern.name.split("*")
        return [pattern.with_name(before + text + after) for text in self.texts]


def _in_order(text: str) -> tuple[list[tuple[int, str]], str]:
    """Order 2 before 10."""
    words = re.split(r"(\d+)", text)
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in words], text
