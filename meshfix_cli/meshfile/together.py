"""A mesh whose parts lie in several files, of which each knows something else: points here, elements there."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from meshfix_cli.errors import ReadError, WriteError
from meshfix_cli.meshfile.source import Layout, Source
from meshfix_cli.meshfile.splice import Points, Turned

Contents = Callable[[Points, Points, Mapping[int, Turned]], list[bytes]]


def all_there(files: Iterable[Path]) -> None:
    """Refuse, as a ReadError, to read a mesh of which files are missing."""
    for one in files:
        if not one.is_file():
            raise ReadError(f"{one.name}, which belongs to it, is not there")


def beside_output(target: Path, there: Path, files: Iterable[Path], others: Iterable[str]) -> list[Path]:
    """Return where files of an input, which its extension tells apart, go beside one of an output.

    Raises
    ------
    WriteError
        A file is there, with one of the other extensions, that would belong to the output.
    """
    mine = [there.with_suffix(one.suffix) for one in files]
    stale = [one for suffix in others if (one := there.with_suffix(suffix)).exists() and one not in mine]
    if stale:
        raise WriteError(f"{target}: {stale[0].name} is there, and would belong to it; name another OUTPUT")
    return mine


@dataclass(frozen=True, eq=False)
class Together:
    """The files of such a mesh; see `source.Pieces`.

    Attributes
    ----------
    main : Path
        What the user names.
    changed : sequence of Path
        The files that may change.
    layout : Layout
        Of what they hold, as one.
    contents : callable
        (points as read, other points, cells to be turned) -> the bytes of each of `changed`.
    parse : callable
        Reads such bytes: a source with a layout of this kind.
    copied : sequence of Path
        Files that go with them as they are.
    places : callable
        (OUTPUT as a path) -> where each of `paths` goes; default: `beside`.
    renamed : callable
        (the bytes of each of `changed`, the names of `places`) -> the same, where files name one another.
    """

    main: Path
    changed: Sequence[Path]
    layout: Layout
    contents: Contents
    parse: Callable[[Sequence[bytes]], Source]
    copied: Sequence[Path] = ()
    places: Callable[[Path], Sequence[Path]] | None = None
    renamed: Callable[[list[bytes], Sequence[str]], list[bytes]] = lambda contents, _: contents

    @property
    def paths(self) -> list[Path]:
        """Where the files are."""
        return [*self.changed, *self.copied]

    def targets(self, target: str) -> list[str]:
        """Return where the files of an output go: those of the input are replaced only where it is the input.

        Raises
        ------
        WriteError
            One of them would be replaced by another.
        """
        if self._in_place(target):
            return [str(path) for path in self.changed]
        there = Path(target)
        found = self.places(there) if self.places else beside(self.main, there, self.paths)
        if len({path.resolve() for path in found}) < len(self.paths):
            raise WriteError(f"{target}: two files of the input would have one name there; name its like")
        for path in found:
            if path.resolve() in {one.resolve() for one in self.paths}:
                raise WriteError(f"{target}: {path.name} would replace a file of the input; name another OUTPUT")
        return [str(path) for path in found]

    def _in_place(self, target: str) -> bool:
        return Path(target).exists() and Path(target).samefile(self.main)

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the files can hold them."""
        return self.layout.rounded(points)

    def turned(self, original: Points, cells: Mapping[int, Turned], threads: int) -> Source:
        """Return what the files hold with some cells turned."""
        return self.parse(self.contents(original, original, cells))

    def files(self, target: str, original: Points, points: Points) -> Iterator[tuple[str, bytes]]:
        """Give names and contents of the files of an output, the first of them last; in place only what changes."""
        targets, contents = self.targets(target), self.contents(original, points, {})
        if self._in_place(target):
            pairs = zip(targets, contents, strict=True)
            yield from reversed([(name, data) for name, data in pairs if data != Path(name).read_bytes()])
            return
        contents = self.renamed(contents, [Path(name).name for name in targets])
        copies = [path.read_bytes() for path in self.copied]
        yield from reversed(list(zip(targets, [*contents, *copies], strict=True)))


def beside(main: Path, target: Path, paths: Sequence[Path]) -> list[Path]:
    """Return where files go that are named after the main one, or not: beside an output, named after that.

    Those of other folders have the names of these in their own, so that two of one name stay two.
    """
    names = []
    for path in paths:
        there = os.path.relpath(path, main.parent).replace(f"..{os.sep}", "").replace(os.sep, "_")
        rest = there.removeprefix(main.stem)
        named_after = rest != there and not rest[:1].isalnum()
        names.append(target.name if path == main else f"{target.stem}{rest if named_after else f'_{there}'}")
    return [target.parent / name for name in names]
