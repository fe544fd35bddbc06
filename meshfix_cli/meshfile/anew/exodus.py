"""Exodus II: a block for each material and type, sets of nodes, sides and elements, fields of one step.

The numbers of elements without any are their places among all of the mesh: blocks part what stood together. Materials
that blocks cannot tell, for these have one type and a number of their own, are a field as well.

Source: L. A. Schoof, V. R. Yarberry, "EXODUS II: a finite element data model", SAND92-2137; SEACAS, "exodusII_int.h".
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS, dimension_of
from meshfix_cli.meshfile.anew.content import IN_XML, Content, Int64, words_of
from meshfix_cli.meshfile.anew.grid import MATERIALS
from meshfix_cli.meshfile.exodus.types import ORDER, sides_of
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import REGIONS

_SHAPES = {
    "vertex": "SPHERE", "line": "BAR", "triangle": "TRI", "quad": "SHELL", "tetra": "TETRA", "pyramid": "PYRAMID",
    "wedge": "WEDGE", "hexahedron": "HEX",
}  # fmt: skip
_BARE = ("vertex", "tetra", "pyramid", "wedge")  # which not all readers know with the number of nodes
HELD = (
    *_SHAPES, "line3", "triangle6", "triangle7", "quad8", "quad9", "tetra10", "pyramid13", "pyramid14", "pyramid19",
    "wedge12", "wedge15", "wedge18", "hexahedron20", "hexahedron27",
)  # fmt: skip
MOST = 2**31 - 1
_LONGEST = 32  # characters of names that all readers take
_MOST_LONG = 255


class _Block(NamedTuple):
    """A block: its number, and which cells of which run it has."""

    number: int
    label: int
    title: str
    run: int
    rows: Int64


def written(content: Content, form: Format) -> bytes:
    """Return a file of netCDF with offsets of 64 bits."""
    from scipy.io import netcdf_file

    if not any(_blocks(content)):
        raise content.refusal(form)
    buffer = io.BytesIO()
    file = netcdf_file(buffer, "w", version=2)
    _File(file, content).write()
    file.flush()
    return buffer.getvalue()


class _File:
    """What is written."""

    def __init__(self, file: Any, content: Content) -> None:
        self.file, self.content = file, content
        self.dimension = content.points.shape[1]
        self.blocks = list(_blocks(content))
        kept = {block.run for block in self.blocks}
        ends = np.cumsum([len(run.vertices) if i in kept else 0 for i, run in enumerate(content.cells)])
        self.starts = [0, *ends.tolist()]
        none = np.empty(0, dtype=np.int64)
        self.ids = np.concatenate([none, *(content.elements[b.run][b.rows] for b in self.blocks)])
        order = np.concatenate([none, *(self.starts[b.run] + b.rows for b in self.blocks)])
        self.places = np.empty(len(order), dtype=np.int64)  # in the file, of each cell
        self.places[order] = np.arange(len(order)) + 1
        names = [*content.titles.values(), *content.sets, *content.point_sets, *self.fields()]
        longest = max((len(name.encode()) for name in names), default=0) + len("_hexahedron27")
        self.longest = _LONGEST if longest <= _LONGEST else min(longest, _MOST_LONG)

    def write(self) -> None:
        """Fill the file."""
        self._head()
        self._blocks()
        sets = self._element_sets()
        sides = list(self._side_sets())
        nodes = {name: (rows + 1,) for name, rows in self.content.point_sets.items()}
        self._sets("node", "ns", {"node_ns": "num_nod_ns"}, nodes, range(1, len(nodes) + 1))
        names = dict(zip([name for name, _, _ in sides], [both for _, _, both in sides], strict=True))
        numbers = [number for _, number, _ in sides]
        self._sets("side", "ss", {"elem_ss": "num_side_ss", "side_ss": "num_side_ss"}, names, numbers)
        self._sets("elem", "els", {"elem_els": "num_ele_els"}, sets, range(1, len(sets) + 1))
        self._fields()

    def _head(self) -> None:
        file, points = self.file, np.asarray(self.content.points, dtype=np.float64)
        file.api_version = np.float32(8.03)
        file.version = np.float32(8.03)
        file.floating_point_word_size, file.file_size = np.int32(8), np.int32(1)
        file.maximum_name_length = np.int32(self.longest)
        file.title = b"written by meshfix"
        sizes = {"time_step": None, "len_string": 33, "len_line": 81, "four": 4, "len_name": self.longest + 1}
        sizes |= {"num_dim": self.dimension, "num_nodes": len(points), "num_elem": len(self.ids)}
        sizes |= {"num_el_blk": len(self.blocks)}
        for name, size in sizes.items():
            file.createDimension(name, size)
        self._put("time_whole", ["time_step"], np.zeros(1))
        for axis in range(self.dimension):
            self._put(f"coord{'xyz'[axis]}", ["num_nodes"], points[:, axis])
        self._names("coor_names", "num_dim", ["x", "y", "z"][: self.dimension])
        if not np.array_equal(self.content.nodes, np.arange(1, len(points) + 1)):
            self._put("node_num_map", ["num_nodes"], self.content.nodes.astype(np.int32))

    def _blocks(self) -> None:
        names = words_of([b.title for b in self.blocks if b.title], IN_XML, self.longest)
        self._names("eb_names", "num_el_blk", [names.get(b.title, "") for b in self.blocks])
        self._put("eb_status", ["num_el_blk"], np.ones(len(self.blocks), np.int32))
        self._put("eb_prop1", ["num_el_blk"], np.array([b.number for b in self.blocks], np.int32)).name = b"ID"
        for i, block in enumerate(self.blocks, 1):
            run = self.content.cells[block.run]
            nodes = run.vertices[block.rows] + 1
            if run.type in ORDER:
                nodes = nodes[:, np.argsort(ORDER[run.type])]
            dimensions = [f"num_el_in_blk{i}", f"num_nod_per_el{i}"]
            for name, size in zip(dimensions, nodes.shape, strict=True):
                self.file.createDimension(name, size)
            table = self._put(f"connect{i}", dimensions, nodes.astype(np.int32))
            table.elem_type = self._type(run.type).encode()
        self._put("elem_num_map", ["num_elem"], self.ids.astype(np.int32))

    def _type(self, key: str) -> str:
        shape = key.rstrip("0123456789")
        name = "QUAD" if shape == "quad" and self.dimension == 2 else _SHAPES[shape]
        return name if key in _BARE else f"{name}{ELEMENTS[key].nodes}"

    def _element_sets(self) -> dict[str, tuple[Int64]]:
        """Sets of cells, and materials that have several blocks."""
        found: dict[str, list[Int64]] = {}
        for name, runs in self.content.sets.items():
            found[name] = [self._places(i, rows) for i, rows in enumerate(runs)]
        for (dimension, number), title in self.content.titles.items():
            mine = [b for b in self.blocks if b.label == number and self._dimension(b) == dimension]
            if len(mine) > 1:
                found[title] = [self._places(b.run, b.rows) for b in mine]
        joined = {name: np.sort(np.concatenate(parts)) for name, parts in found.items() if parts}
        return {name: (rows,) for name, rows in joined.items() if len(rows)}

    def _dimension(self, block: _Block) -> int:
        return dimension_of(self.content.cells[block.run].type)

    def _places(self, run: int, rows: Int64) -> Int64:
        """Return the numbers in the file of some cells of a run; none where it is left out."""
        if self.starts[run] == self.starts[run + 1]:
            return rows[:0]
        return self.places[self.starts[run] + rows]

    def _side_sets(self) -> Iterator[tuple[str, int, tuple[Int64, Int64]]]:
        """Groups of facets, as sides of the elements that have them; their numbers are those of the blocks."""
        facets = {b.number: (b.title, [(b.run, b.rows)]) for b in self.blocks if self._is_of_facets(b.run) and b.label}
        free = max((b.number for b in self.blocks), default=0)
        for name, runs in self.content.sets.items():
            mine = [(i, rows) for i, rows in enumerate(runs) if len(rows) and self._is_of_facets(i)]
            if mine:
                free += 1
                facets[free] = (name, mine)
        for number, (title, parts) in facets.items():
            elements, sides = self._sides(parts)
            if len(elements):
                yield f"{title}_sides" if title else f"sides_{number}", number, (elements, sides)

    def _is_of_facets(self, run: int) -> bool:
        return dimension_of(self.content.cells[run].type) == self.content.dimension - 1

    def _sides(self, parts: Sequence[tuple[int, Int64]]) -> tuple[Int64, Int64]:
        """Return elements and the numbers of their sides, for facets of some runs; one where two elements meet."""
        cells = self.content.cells
        wanted = [_corners(cells[i].type, cells[i].vertices[rows]) for i, rows in parts]
        near = np.zeros(len(self.content.points), dtype=bool)
        for facets in wanted:
            near[facets] = True
        found: dict[tuple[int, ...], tuple[int, int]] = {}
        for i in {b.run: None for b in self.blocks if self._dimension(b) == self.content.dimension}:
            run = cells[i]
            size = ELEMENTS[run.type].shape.corners
            order = np.argsort(ORDER.get(run.type, range(run.vertices.shape[1])))
            for side, nodes in enumerate(sides_of(run.type, self._type(run.type), self.dimension), 1):
                corners = run.vertices[:, order[[node for node in nodes if node < size]]]
                rows = np.flatnonzero(near[corners].all(axis=1))
                keys = map(tuple, np.sort(corners[rows], axis=1).tolist())
                for key, place in zip(keys, self._places(i, rows).tolist(), strict=True):
                    found.setdefault(key, (place, side))
        asked = (tuple(row) for facets in wanted for row in np.sort(facets, axis=1).tolist())
        pairs = np.array([found[key] for key in asked if key in found], dtype=np.int64).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def _sets(
        self, kind: str, short: str, tables: Mapping[str, str], sets: Mapping[str, Sequence[Int64]], ids: Sequence[int]
    ) -> None:
        if not sets:
            return
        count = f"num_{kind}_sets"
        self.file.createDimension(count, len(sets))
        names = words_of(list(sets), IN_XML, self.longest)
        self._names(f"{short}_names", count, [names[name] for name in sets])
        self._put(f"{short}_status", [count], np.ones(len(sets), np.int32))
        self._put(f"{short}_prop1", [count], np.array(ids, np.int32)).name = b"ID"
        for i, values in enumerate(sets.values(), 1):
            for size in dict.fromkeys(tables.values()):
                self.file.createDimension(f"{size}{i}", len(values[0]))
            for (table, size), numbers in zip(tables.items(), values, strict=True):
                self._put(f"{table}{i}", [f"{size}{i}"], numbers.astype(np.int32))

    def fields(self) -> dict[str, list[NDArray[Any]]]:
        """Return data of cells, an array for each run; that of materials only where blocks do not tell them."""
        arrays = {name: [np.asarray(runs) for runs in of] for name, of in self.content.arrays.cell.items()}
        region = self.content.region
        if region is not None:
            labels = arrays.pop(region)
            if any(block.number != block.label for block in self.blocks):
                arrays = {region if region in REGIONS else MATERIALS: labels, **arrays}
        return arrays

    def _fields(self) -> None:
        point = dict(_columns({name: [np.asarray(of)] for name, of in self.content.arrays.point.items()}))
        cell = dict(_columns(self.fields()))
        for kind, short, fields in (("nod", "nod", point), ("elem", "elem", cell)):
            if fields:
                self.file.createDimension(f"num_{kind}_var", len(fields))
                words = words_of(list(fields), IN_XML, self.longest)
                self._names(f"name_{short}_var", f"num_{kind}_var", [words[name] for name in fields])
        for i, (values,) in enumerate(point.values(), 1):
            self._put(f"vals_nod_var{i}", ["time_step", "num_nodes"], values[None])
        if cell:
            told = np.ones((len(self.blocks), len(cell)), np.int32)
            self._put("elem_var_tab", ["num_el_blk", "num_elem_var"], told)
        for i, runs in enumerate(cell.values(), 1):
            for j, block in enumerate(self.blocks, 1):
                values = runs[block.run][block.rows]
                self._put(f"vals_elem_var{i}eb{j}", ["time_step", f"num_el_in_blk{j}"], values[None])

    def _put(self, name: str, dimensions: Sequence[str], values: NDArray[Any]) -> Any:
        variable = self.file.createVariable(name, values.dtype.str[1:] if values.dtype.kind != "S" else "c", dimensions)
        variable[:] = values
        return variable

    def _names(self, name: str, dimension: str, texts: Sequence[str]) -> None:
        """Put texts, each up to a zero."""
        size = self.longest + 1
        rows = [np.frombuffer(text.encode()[: size - 1].ljust(size, b"\0"), dtype="S1") for text in texts]
        self._put(name, [dimension, "len_name"], np.array(rows))


def _blocks(content: Content) -> Iterator[_Block]:
    """Number the parts of the mesh as their materials are, where no other has the number."""
    parts = [part for part in content.parts() if part[0].type in HELD]
    taken: set[int] = set()
    free = max((label for _, label, _ in parts if label < 1 << 30), default=0)
    runs = {id(run): i for i, run in enumerate(content.cells)}
    keys = [(dimension_of(run.type), label) for run, label, _ in parts]
    for (run, label, rows), key in zip(parts, keys, strict=True):
        number = label
        if label in taken or not 0 < label < 1 << 30:
            free = number = max(free, 0) + 1
        taken.add(number)
        title = content.titles.get(key, "")
        several = title and keys.count(key) > 1
        yield _Block(number, label, f"{title}_{run.type}" if several else title, runs[id(run)], rows)


def _columns(fields: Mapping[str, Sequence[NDArray[Any]]]) -> Iterator[tuple[str, list[NDArray[np.float64]]]]:
    """Give the columns of data by names of their own: those of vectors end in _x, _y and _z."""
    for name, runs in fields.items():
        if any(values.dtype.kind not in "biuf" for values in runs):
            continue
        tables = [values.reshape(len(values), math.prod(values.shape[1:])).astype(np.float64) for values in runs]
        columns = tables[0].shape[1] if tables else 0
        ends = "xyz" if columns in (2, 3) else range(1, columns + 1)
        for i, end in zip(range(columns), ends, strict=False):
            yield name if columns == 1 else f"{name}_{end}", [table[:, i] for table in tables]


def _corners(key: str, vertices: Any) -> NDArray[np.int64]:
    corners: NDArray[np.int64] = vertices[:, : ELEMENTS[key].shape.corners]
    return corners
