"""Where the coordinates of an XDMF file stand, in it and in the files beside it, all joined one behind the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Layout
from meshfix_cli.meshfile.splice import InPlace, Places, Points, Turned, differing
from meshfix_cli.meshfile.vtk.xml import Element
from meshfix_cli.meshfile.xdmf.cells import Run, Topology
from meshfix_cli.meshfile.xdmf.items import Contents, Item, item_of
from meshfix_cli.meshfile.xdmf.tree import Tree, said


class Divided(Layout, Protocol):
    """The layout of files that are joined, which gives them one by one as well."""

    def divided(
        self, original: Points, points: Points, reversed_cells: Mapping[int, Turned], bounds: Sequence[int]
    ) -> list[bytes]:
        """Return each file with other points (n, d), and some cells turned; `bounds`: where the second begins, ..."""


class Geometry(NamedTuple):
    """Points: their numbers, and whether each coordinate has a data item of its own."""

    items: Sequence[Item]
    shape: tuple[int, int]
    apart: bool

    @property
    def place(self) -> tuple[object, ...]:
        """What is the same for two that are the same points."""
        return tuple(item.place for item in self.items)

    @property
    def at(self) -> NDArray[np.int64]:
        """(n, d) int64: which of the numbers each coordinate is."""
        at = np.arange(math.prod(self.shape))
        return at.reshape(self.shape[::-1]).T if self.apart else at.reshape(self.shape)

    def read(self, contents: Contents) -> Points:
        """Return the points (n, d)."""
        found = [contents.read(item) for item in self.items]
        return np.column_stack(found) if self.apart else found[0].reshape(self.shape)

    def places(self, contents: Contents) -> Places | None:
        """Return where the points stand in the joined data; None: they are compressed there."""
        parts = [contents.places(item) for item in self.items]
        found = [part for part in parts if part is not None]
        if len(found) < len(parts) or len({(part.dtype, part.end is None) for part in found}) != 1:
            return None
        begin = np.concatenate([part.begin for part in found])[:, 0]
        ends = [part.end[:, 0] for part in found if part.end is not None]
        at = self.at
        return Places(begin[at], np.concatenate(ends)[at] if ends else None, found[0].dtype)


def geometry_of(tree: Tree, element: Element) -> Geometry:
    """Read where the points of a grid are."""
    kind = said(element, "GeometryType", "Type") or "xyz"
    if kind not in ("xyz", "xy", "x", "x_y_z", "x_y"):
        raise ReadError(f"has points of the type {kind!r}, which meshfix does not read")
    dimension = len(kind.replace("_", ""))
    items = [item_of(tree, element, number) for number in range(dimension if "_" in kind else 1)]
    sizes = {item.size for item in items}
    n, rest = divmod(items[0].size, 1 if "_" in kind else dimension)
    if len(sizes) > 1 or rest:
        raise ReadError(
            f"is not a readable xdmf file: {items[0].size:,} numbers are no points of the type {kind.upper()}"
        )
    if any(item.dtype.str[1:] not in ("f4", "f8") for item in items):
        raise ReadError("is not a readable xdmf file: its coordinates are neither of single nor of double precision")
    return Geometry(items, (n, dimension), "_" in kind)


def points_and_layout(
    contents: Contents, copies: Sequence[Geometry], corners: Sequence[tuple[Topology, Run]]
) -> tuple[Points, Divided]:
    """Return the points (n, d) that stand in one place or, all the same, in several, and where they are written."""
    found = [geometry.places(contents) for geometry in copies]
    places = [one for one in found if one is not None]
    points = copies[0].read(contents)
    kinds = {(one.dtype, one.end is None) for one in places}
    whole = len(places) == len(copies) and len(kinds) == 1
    # What the library of HDF5 says of places is not believed where it reads other numbers.
    if not whole or any(one.read(contents.joined).tobytes() != points.tobytes() for one in places):
        return points, _Packed(contents, ["", *contents.names], copies, points.dtype)
    turns = [_Corners(contents, *one) for one in corners]
    if len(places) == 1:
        return points, InPlace(contents.joined, places[0], turns)
    begin = np.concatenate([one.begin for one in places])
    ends = [one.end for one in places if one.end is not None]
    together = Places(begin, np.concatenate(ends) if ends else None, places[0].dtype)
    return points, _Repeated(InPlace(contents.joined, together, turns), len(copies))


@dataclass(frozen=True, eq=False)
class _Corners:
    """Finds the vertices of a run of cells."""

    contents: Contents
    topology: Topology
    run: Run

    def __call__(self) -> Places:
        places = self.contents.places(self.topology.item)
        if places is None:
            raise ReadError("has cells that are compressed, and which so cannot be renumbered")
        return places.at((self.run.at, 0))


@dataclass(frozen=True, eq=False)
class _Repeated:
    """Points that stand in several places."""

    layout: InPlace
    copies: int

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the file can hold them."""
        return self.layout.rounded(points)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, d), and with some cells turned."""
        return self.divided(original, points, reversed_cells, ())[0]

    def divided(
        self, original: Points, points: Points, reversed_cells: Mapping[int, Turned], bounds: Sequence[int]
    ) -> list[bytes]:
        """Return the same in the parts into which ascending offsets divide the joined files."""
        many = (self.copies, 1)
        return self.layout.divided(np.tile(original, many), np.tile(points, many), reversed_cells, bounds)


@dataclass(frozen=True, eq=False)
class _Packed:
    """Points of which some are in data sets that the library of HDF5 must write."""

    contents: Contents
    names: Sequence[str]
    copies: Sequence[Geometry]
    dtype: np.dtype[Any]

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the file can hold them."""
        return points.astype(self.dtype, copy=False)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the joined files with other points (n, d)."""
        return b"".join(self.divided(original, points, reversed_cells, ()))

    def divided(
        self, original: Points, points: Points, reversed_cells: Mapping[int, Turned], bounds: Sequence[int]
    ) -> list[bytes]:
        """Return each file with other points (n, d)."""
        if reversed_cells:
            raise ReadError("has coordinates that are compressed, beside which no cell can be renumbered")
        files = {name: self.contents.of_file(name) for name in self.names}
        which = differing(original, points)
        for geometry in self.copies:
            starts, at = np.cumsum([0, *(item.size for item in geometry.items)]), geometry.at
            for item, (first, last) in zip(geometry.items, pairwise(starts.tolist()), strict=True):
                here = which & (at >= first) & (at < last)
                if here.any():
                    files[item.file] = _written(files[item.file], item, at[here] - first, points[here])
        return [files[name] for name in self.names]


def _written(data: bytes, item: Item, at: NDArray[np.int64], values: NDArray[Any]) -> bytes:
    """Return a file in which some numbers of a data set are others."""
    if item.form != "hdf":
        raise ReadError("has coordinates of which some are compressed, which meshfix does not read")

    def edit(numbers: NDArray[Any]) -> None:
        numbers[at] = values

    return Table([item.path], np.arange(item.size)[:, None]).written(data, "HDF5", edit)
