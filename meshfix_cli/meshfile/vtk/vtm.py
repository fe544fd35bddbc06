"""VTK's XML files that name several data sets: blocks, .vtm and .vtmb, partitions, .vtpc and .vtpd, or series, .pvd.

A block is a region, and has the name of its path among the blocks; points of several that lie at one place on their
boundaries are one. Of a series one step in time is read.

Source: VTK, "vtkXMLCompositeDataReader.cxx"; ParaView Guide, "PVD File Format".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from meshfix_cli.errors import ReadError, WriteError
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.source import Arrays, Source
from meshfix_cli.meshfile.vtk.pvtu import Index, Kind, read_index
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile

TYPES = ("vtkMultiBlockDataSet", "vtkPartitionedDataSetCollection", "vtkPartitionedDataSet", "Collection")
_KIND = Kind("vtm", "vtu vtp vts", "")
_BLOCK = "vtk:block"


class Blocks(Index):
    """A file that names data sets."""

    attribute = "file"

    @classmethod
    def of(cls, data: bytes, path: Path | None) -> Index:
        """Read which blocks there are; None: there is no file beside which they could be.

        Raises
        ------
        ReadError
            There are none, or several steps in time.
        """
        file, there = read_index(data, path)
        found = [element for element, _ in _data_sets(file)]
        steps = {element.attributes.get("timestep", "0").strip() for element in found}
        if len(steps) > 1:
            raise ReadError(f"names {len(steps)} steps in time, and one mesh is read: name the file of one step")
        if not found:
            raise ReadError("is not a readable vtm file: it names no files of blocks")
        return cls(there, file, found, _KIND).checked()

    def parse(self, contents: Sequence[bytes]) -> list[Source]:
        """Read the blocks, each a region of its own."""
        sources = super().parse(contents)
        if len(sources) < 2:
            return sources
        regions = tuple(dict.fromkeys(name for source in sources for name in source.regions))
        names = _distinct([name for _, name in _data_sets(self.file)])
        return [_labelled(*pair, i, regions) for i, pair in enumerate(zip(sources, names, strict=True), start=1)]

    def pieces_in(self, file: XmlFile) -> list[Element]:
        """Return what stands for the blocks in such a file."""
        return [element for element, _ in _data_sets(file)]

    def targets(self, target: str) -> list[str]:
        """Return where the blocks of an output go; see `Index`."""
        mine, suffix = self.path.suffix.lower(), Path(target).suffix.lower()
        if suffix != mine:
            raise WriteError(
                f"{target}: the blocks of a {mine} are named by a file of this kind; name an OUTPUT like it"
            )
        return super().targets(target)

    def _unlike(self) -> str:
        return "is a block, and not a .vtu, .vtp or .vts file"


def _data_sets(file: XmlFile) -> Iterator[tuple[Element, str]]:
    """Give the elements that name files, and the paths of their names among the blocks."""
    for tag in TYPES:
        for top in file.root.named(tag):
            yield from _within(top, "")


def _within(parent: Element, path: str) -> Iterator[tuple[Element, str]]:
    for i, child in enumerate(parent.children):
        own = child.attributes.get("name") or child.attributes.get("part") or child.attributes.get("index") or str(i)
        name = f"{path}/{own}" if path else own
        if child.tag == "DataSet" and child.attributes.get("file", "").strip():
            yield child, name
        elif child.tag in ("Block", "Piece", "Partitions"):
            yield from _within(child, name)


def _distinct(names: Sequence[str]) -> list[str]:
    return [name if names.count(name) == 1 else f"{name} ({i})" for i, name in enumerate(names)]


def _labelled(source: Source, name: str, number: int, regions: Sequence[str]) -> Source:
    """Return a block with its number for a label, and with all labels that others have; its name is a set."""
    load = cache(partial(_arrays, source, name, number, regions))
    return replace(source, load=load, regions=(_BLOCK, *regions), numbers=lambda: None)


def _arrays(source: Source, name: str, number: int, regions: Sequence[str]) -> Arrays:
    sizes = [len(run.vertices) for run in source.cells]
    labels = {one: [np.zeros(size, dtype=np.int64) for size in sizes] for one in regions}
    cell = {**labels, **source.arrays.cell, _BLOCK: [np.full(size, number) for size in sizes]}
    numbered = {key: group.rows(source) for key, group in groups_of(source).items() if key in source.arrays.groups}
    sets = {**numbered, **source.arrays.cell_sets, name: [np.arange(size) for size in sizes]}
    return replace(source.arrays, cell=cell, groups={}, cell_sets=sets)  # blocks are numbered, and no groups
