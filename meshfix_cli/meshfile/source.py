"""What a file holds, whatever its format."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.splice import InPlace, Points, Turned

# Cell arrays that tell materials apart: those of this package and of meshio, and those that other programs write.
PHYSICAL = "gmsh:physical"
REGIONS = (
    PHYSICAL, "gmsh:physical_set", "medit:ref", "cell_tags", "abaqus:section", "obj:material", "stl:solid",
    "nastran:ref", "avsucd:material", "exodus:block", "flac3d:group", "netgen:index", "tetgen:ref", "ugrid:ref",
    "MaterialIDs", "CellEntityIds", "RegionId",
)  # fmt: skip
NO_NUMBER = -1
# What is left of their names in small letters, without "id", "ids" and what is no letter.
_LIKE = frozenset({
    "material", "materials", "mat", "region", "regions", "cellentity", "part", "block", "elementblock", "subdomain",
    "domain", "zone", "attribute",
})  # fmt: skip


def regions_among(names: Iterable[str]) -> tuple[str, ...]:
    """Return which cell arrays tell materials apart: `material_id`, `MatID` and `Region` are as good as `REGIONS`."""
    present = list(names)
    known = [name for name in REGIONS if name in present]
    words = {name: re.sub(r"ids?$", "", re.sub(r"[^a-z]", "", name.lower())) for name in present}
    return (*known, *(name for name in present if name not in known and words[name] in _LIKE))


@dataclass(frozen=True, eq=False)
class Cells:
    """A run of cells of one type, in the order of the file.

    Attributes
    ----------
    type : str
        A key of `elements.ELEMENTS`, or a name of the same kind: "triangle", "tetra", "line", "triangle6", ...
    vertices : (m, k) int
        Rows of the points; a list of arrays where the cells have different numbers of vertices.
    ids : (m,) int64 or None
        The numbers that the file gives to them; NO_NUMBER for those among cells of a type that have none.
    ghosts : (m,) bool or None
        Cells that another piece of the mesh has as well.
    """

    type: str
    vertices: Any
    ids: NDArray[np.int64] | None = None
    ghosts: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Arrays:
    """Data beside points and cells, under the names of the file and in the shapes of meshio.

    Attributes
    ----------
    point : dict
        An array (n, ...) for each name.
    cell : dict
        For each name an array (m, ...) for each run of cells.
    groups : dict
        For each name of a group its number, in the cell data PHYSICAL or, where there are none, in those of regions,
        and its dimension: meshio's `field_data`.
    point_sets : dict
        Rows of points for each name.
    cell_sets : dict
        For each name the rows of cells in each run.
    unread : tuple of str
        What is there and cannot be read.
    """

    point: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    cell: Mapping[str, Sequence[NDArray[Any]]] = field(default_factory=dict)
    groups: Mapping[str, Any] = field(default_factory=dict)
    point_sets: Mapping[str, Any] = field(default_factory=dict)
    cell_sets: Mapping[str, Any] = field(default_factory=dict)
    unread: tuple[str, ...] = ()


class Layout(Protocol):
    """Where a file holds the numbers that meshfix may change; see `splice.InPlace`."""

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the file can hold them."""

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, d), and with some cells turned."""


class Family(Protocol):
    """The files of one mesh, and what they are called."""

    @property
    def form(self) -> Format:
        """The format of all of them together."""

    @property
    def names(self) -> Sequence[str]:
        """The pieces, as a user knows them."""

    @property
    def paths(self) -> Sequence[Path]:
        """Where the pieces are."""

    @property
    def numbers(self) -> str:
        """What the numbers are called by which points are joined."""

    @property
    def by_position(self) -> bool:
        """Whether cells are named by their position among those of all pieces; else they have numbers of their own."""

    def parse(self, contents: Sequence[bytes]) -> list[Source]:
        """Read the pieces."""

    def promoted(self, contents: Sequence[bytes]) -> tuple[Family, list[bytes]]:
        """Return the pieces with coordinates in float64, and the family that they make."""

    def targets(self, target: str) -> list[str]:
        """Return where the pieces of an output go; WriteError where that cannot be."""

    def beside(self, target: str, targets: Sequence[str]) -> list[tuple[str, bytes]]:
        """Return the names and contents of what is written beside the pieces."""


class Pieces(Protocol):
    """What stands for the layout of a mesh that lies in several files; see `pieces.Joined` and `together.Together`."""

    @property
    def paths(self) -> Sequence[Path]:
        """Where the files are."""

    def targets(self, target: str) -> list[str]:
        """Return where those of an output go; WriteError where that cannot be."""

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the files can hold them."""

    def turned(self, original: Points, cells: Mapping[int, Turned], threads: int) -> Source:
        """Return what the files hold with some cells turned."""

    def files(self, target: str, original: Points, points: Points) -> Iterator[tuple[str, bytes]]:
        """Give names and contents of the files of an output, what names the others last."""


@dataclass(frozen=True, eq=False)
class Source:
    """A file as read.

    Attributes
    ----------
    points : (n, d) float32 or float64
        d = 2 or 3 as in the file.
    cells : sequence of Cells
    layout : Layout or None
    load : callable
        Gives the arrays; they are read when they are asked for.
    regions : tuple of str
        Names of cell arrays that tell materials apart.
    held : (n,) bool or None
        Points that the file itself declares as fixed, or that must not move alone.
    untold : tuple of str
        What the file holds beside `arrays`, and no other format would: comments, sections, keywords.
    notes : tuple of str
        What a user should know about the file, a sentence each.
    numbers : callable
        Gives the numbers (n,) int64 of the points, by which pieces of a mesh tell which of them are the same; None:
        the file has none.
    data : bytes or None
        The file as it is, where it can only be written anew: unmoved it is given back.
    oriented : bool
        The numbering of cells tells their orientation.
    apart : bool
        The parts of the mesh have coordinates of their own, in which they may lie over one another.
    pieces : Pieces or None
        What stands for the layout where the mesh lies in several files. With neither it can only be written anew.
    packed : bytes or None
        The file as it is, where gzip has compressed it.
    """

    points: Points
    cells: Sequence[Cells]
    layout: Layout | None = None
    load: Callable[[], Arrays] = Arrays
    regions: tuple[str, ...] = ()
    held: NDArray[np.bool_] | None = None
    untold: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    numbers: Callable[[], NDArray[np.int64] | None] = lambda: None
    data: bytes | None = field(default=None, repr=False)
    oriented: bool = True
    apart: bool = False
    pieces: Pieces | None = None
    packed: bytes | None = field(default=None, repr=False)

    @property
    def spliced(self) -> bool:
        """Whether all but the coordinates can be written back as it was."""
        return self.layout is not None or self.pieces is not None

    @cached_property
    def arrays(self) -> Arrays:
        """What `load` gives."""
        return self.load()

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the file can hold them."""
        layout = self.pieces or self.layout
        return points if layout is None else layout.rounded(points)

    @property
    def exact(self) -> bool:
        """Whether the file is known to hold points of the type of these as they are."""
        layout = self.pieces or self.layout
        return layout is None or (isinstance(layout, InPlace) and layout.coordinates.holds(self.points.dtype))

    def vertices_of(self, kind: str, corners: int) -> NDArray[np.int64]:
        """Return the vertices (k, corners) of all cells of a type, in the order of the file."""
        runs = [run.vertices for run in self.cells if run.type == kind]
        return runs[0] if len(runs) == 1 else np.concatenate(runs or [np.empty((0, corners), dtype=np.int64)])

    def merged(self) -> Source:
        """Return the same with one run for all cells of a type: some programs read no more than one of each."""
        groups, mine = self._alike(), self.arrays
        cells = [_as_one([self.cells[i] for i in runs]) for runs in groups]
        cell = {name: [_joined([values[i] for i in runs]) for runs in groups] for name, values in mine.cell.items()}
        sets = {}
        for name, rows in mine.cell_sets.items():
            parts = ([rows[i] + start for i, start in zip(runs, self._starts(runs), strict=True)] for runs in groups)
            sets[name] = [_joined(part) for part in parts]
        arrays = replace(mine, cell=cell, cell_sets=sets)
        return replace(self, cells=cells, load=lambda: arrays)

    def in_order(self, numbered: Source | None = None) -> Source:
        """Return the same with one run for all cells of a type, ordered by their numbers; itself if they stand so.

        Parameters
        ----------
        numbered : Source, optional
            One of the same cells that gives the numbers; default: itself.
        """
        ids = [run.ids for run in (numbered or self).cells]
        orders = [self._order(runs, [ids[i] for i in runs]) for runs in self._alike()]
        if all((order[1:] > order[:-1]).all() for order in orders):
            return self
        return self.merged()._rows(orders)

    def there(self) -> Source:
        """Return the same without the cells that name points that are not there; itself if there are none."""
        n, tables = len(self.points), [run.vertices for run in self.cells]
        named = [((rows >= 0) & (rows < n)).all(axis=1) if isinstance(rows, np.ndarray) else None for rows in tables]
        if all(mask is None or mask.all() for mask in named):
            return self
        sizes = map(len, tables)
        orders = [np.arange(m) if mask is None else np.flatnonzero(mask) for mask, m in zip(named, sizes, strict=True)]
        return self._rows(orders)

    def _rows(self, orders: Sequence[NDArray[np.int64]]) -> Source:
        """Return the same with some cells of each run, in some order."""
        mine, pairs = self.arrays, list(enumerate(orders))
        cells = [_in(order, self.cells[i]) for i, order in pairs]
        cell = {name: [values[i][order] for i, order in pairs] for name, values in mine.cell.items()}
        sets = {
            name: [np.flatnonzero(np.isin(order, rows[i])) for i, order in pairs]
            for name, rows in mine.cell_sets.items()
        }
        arrays = replace(mine, cell=cell, cell_sets=sets)
        return replace(self, cells=cells, load=lambda: arrays)

    def _alike(self) -> list[list[int]]:
        """Return which runs have cells of one type and as many vertices."""
        alike: dict[tuple[str, int], list[int]] = {}
        for i, run in enumerate(self.cells):
            width = run.vertices.shape[1] if isinstance(run.vertices, np.ndarray) else -1 - i
            alike.setdefault((run.type, width), []).append(i)
        return list(alike.values())

    def _order(self, runs: Sequence[int], ids: Sequence[NDArray[np.int64] | None]) -> NDArray[np.int64]:
        """Return the order of the cells of some runs, that of the file where one of these has no numbers."""
        numbers = [mine for mine in ids if mine is not None]
        if len(numbers) < len(runs) or not isinstance(self.cells[runs[0]].vertices, np.ndarray):
            return np.arange(sum(len(self.cells[i].vertices) for i in runs))
        return np.argsort(_joined(numbers), kind="stable")

    def _starts(self, runs: Sequence[int]) -> list[int]:
        """How many cells stand before each of some runs when these are joined."""
        return [0, *accumulate(len(self.cells[i].vertices) for i in runs[:-1])]


def ghost_vertices(cells: Sequence[Cells], n: int) -> NDArray[np.bool_] | None:
    """Mark the points (n,) of ghost cells; None: no cells are marked so."""
    if all(run.ghosts is None for run in cells):
        return None
    mask = np.zeros(n, dtype=bool)
    for run in cells:
        vertices = run.vertices[run.ghosts] if run.ghosts is not None else np.empty(0, dtype=np.int64)
        mask[vertices[(vertices >= 0) & (vertices < n)]] = True
    return mask


def _as_one(runs: Sequence[Cells]) -> Cells:
    """Return the cells of runs of one type, with their numbers if any has some."""
    numbers = [np.full(len(run.vertices), NO_NUMBER) if run.ids is None else run.ids for run in runs]
    there = any(run.ids is not None for run in runs)
    return Cells(runs[0].type, _joined([run.vertices for run in runs]), _joined(numbers) if there else None)


def _in(order: NDArray[np.int64], run: Cells) -> Cells:
    """Return cells in another order."""
    vertices = run.vertices[order] if isinstance(run.vertices, np.ndarray) else run.vertices
    return Cells(run.type, vertices, None if run.ids is None else run.ids[order])


def _joined(parts: Sequence[Any]) -> Any:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
