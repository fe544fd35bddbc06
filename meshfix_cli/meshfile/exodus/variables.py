"""The variables of an Exodus file, whichever form of netCDF it has, and where their numbers stand in it.

Source: Unidata, "NetCDF Classic Format Specification"; "NetCDF-4/HDF5 File Format".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import hdf5, netcdf
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Layout
from meshfix_cli.meshfile.splice import InPlace, Places

FORM = "exodus"


class Variable(Protocol):
    """A table of numbers or characters."""

    @property
    def shape(self) -> tuple[int, ...]:
        """How many there are; the number of records first, where it has any."""

    def text(self, name: str) -> str:
        """Return an attribute, which is a text; empty: there is none."""

    def values(self) -> NDArray[Any]:
        """Return them in the machine's byte order."""

    def last(self) -> NDArray[Any]:
        """Return those of the last record."""


class Variables(Protocol):
    """Those of a file, by their names."""

    @property
    def named(self) -> Mapping[str, Variable]:
        """All of them."""

    def layout(self, points: Table, corners: Sequence[Callable[[], Table]]) -> Layout:
        """Return where the file holds its coordinates, and the vertices of each run of cells."""


@contextmanager
def opened(data: bytes) -> Iterator[Variables]:
    """Give the variables of a file; ReadError where it is damaged."""
    if data[:4] in netcdf.MAGIC:
        yield _Classic(data, netcdf.parse(data))
        return
    with hdf5.opened(data, FORM) as root:
        yield _OfHdf5(data, root)


@dataclass(frozen=True, eq=False)
class _Classic:
    """The variables of a file of netCDF's own."""

    data: bytes = field(repr=False)
    named: Mapping[str, netcdf.Variable]

    def layout(self, points: Table, corners: Sequence[Callable[[], Table]]) -> Layout:
        """Return where the file holds its coordinates, and the vertices of each run of cells."""
        kinds = {self.named[name].dtype.str for name in points.sets}
        if kinds not in ({">f4"}, {">f8"}):
            raise ReadError(
                "is not a readable exodus file: its coordinates are not all of single or of double precision"
            )
        return InPlace(self.data, self._places(points), [partial(self._places_of, one) for one in corners])

    def _places_of(self, table: Callable[[], Table]) -> Places:
        return self._places(table())

    def _places(self, table: Table) -> Places:
        found = [self.named[name] for name in table.sets]
        begin = np.concatenate([one.offsets().ravel() for one in found])
        return Places(begin[table.at], None, found[0].dtype)


@dataclass(frozen=True, eq=False)
class _OfHdf5:
    """The variables of a file of HDF5, while it is open."""

    data: bytes = field(repr=False)
    root: Any

    @property
    def named(self) -> Mapping[str, Variable]:
        """All of them."""
        return _Named(self.root)

    def layout(self, points: Table, corners: Sequence[Callable[[], Table]]) -> Layout:
        """Return where the file holds its coordinates, and the vertices of each run of cells."""
        return hdf5.layout(self.root, self.data, FORM, points, corners)


@dataclass(frozen=True, eq=False)
class _Named(Mapping[str, Variable]):
    """The data sets of a file of HDF5, which are looked at when they are asked for: dimensions have some as well."""

    root: Any

    def __getitem__(self, name: str) -> Variable:
        found = hdf5.data_set(self.root, name)
        if found is None:
            raise KeyError(name)
        return _Stored(found)

    def __contains__(self, name: object) -> bool:
        return name in self.root

    def __iter__(self) -> Iterator[str]:
        return iter(self.root)

    def __len__(self) -> int:
        return len(self.root)


@dataclass(frozen=True, eq=False)
class _Stored:
    """A data set of HDF5."""

    found: Any

    @property
    def shape(self) -> tuple[int, ...]:
        """How many there are; the number of records first, where it has any."""
        return tuple(self.found.shape)

    def text(self, name: str) -> str:
        """Return an attribute, which is a text; empty: there is none."""
        return str(hdf5.attribute(self.found, name, ""))

    def values(self) -> NDArray[Any]:
        """Return them in the machine's byte order."""
        return hdf5.numbers(self.found, "iufS")

    def last(self) -> NDArray[Any]:
        """Return those of the last record."""
        return np.asarray(self.found[-1])
