"""A mesh as VTK's files and those of XDMF hold it: sets are bytes that mark their members, names stand beside."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.anew.content import Content
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import regions_among
from meshfix_cli.meshfile.vtk.cells import number_of, order_of

Arrays = Mapping[str, NDArray[Any]]
MATERIALS = "MaterialIDs"  # what the array is called where its own name tells no program that it is one


@dataclass(frozen=True, eq=False)
class Grid:
    """Points and cells.

    Attributes
    ----------
    points : (n, 3) float64
    types : sequence of int
        Those of runs of cells.
    vertices : sequence of (m, k) int64
        Of each run.
    point, cell : mapping
        An array (n,) or (n, k), or one of the cells of all runs, for each name.
    about : mapping
        For each name of a group of cells the array of its number and its dimension.
    """

    points: NDArray[np.float64]
    types: list[int]
    vertices: list[NDArray[np.int64]]
    point: Arrays
    cell: Arrays
    about: Arrays

    @classmethod
    def of(cls, content: Content, form: Format, old: bool) -> Grid:
        """Return what can be held; in old files hexahedra of any order have another order of nodes.

        Raises
        ------
        WriteError
            Nothing can.
        """
        numbers = [
            number_of(run.type) if isinstance(run.vertices, np.ndarray) and len(run.vertices) else None
            for run in content.cells
        ]
        kept = [(i, number) for i, number in enumerate(numbers) if number is not None]
        if not kept:
            raise content.refusal(form)
        vertices = []
        for i, number in kept:
            order = order_of(content.cells[i].type, number) if old else None
            rows = content.cells[i].vertices.astype(np.int64, copy=False)
            vertices.append(rows if order is None else rows[:, np.argsort(order)])
        data = data_of(content, [i for i, _ in kept])
        return cls(content.in_space(), [number for _, number in kept], vertices, *data)

    def offsets(self) -> NDArray[np.int64]:
        """Return where the vertices of each cell end."""
        return np.cumsum(np.repeat([one.shape[1] for one in self.vertices], [len(one) for one in self.vertices]))

    def kinds(self) -> NDArray[np.uint8]:
        """Return the type of each cell."""
        return np.repeat(np.array(self.types, dtype=np.uint8), [len(one) for one in self.vertices])


def data_of(content: Content, kept: list[int]) -> tuple[Arrays, Arrays, Arrays]:
    """Return data of points and of the cells of some runs, with sets among them, and what tells of groups."""
    cell = dict(_numbers(_of_cells(content, kept)))
    sizes = [len(content.cells[i].vertices) for i in kept]
    masks = {name: _marked(sizes, [runs[i] for i in kept]) for name, runs in content.sets.items()}
    point = dict(_numbers(content.arrays.point.items()))
    nodes = {name: _marked([len(content.points)], [one]) for name, one in content.point_sets.items()}
    about = {name: np.array([number, dimension]) for (dimension, number), name in content.titles.items()}
    return _with(point, nodes), _with(cell, masks), about


def _of_cells(content: Content, rows: list[int]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Give names and values of data of the cells of some runs; that of materials is called so that readers know it."""
    names = content.arrays.cell
    for name, runs in names.items() if rows else ():
        unknown = name == content.region and not regions_among([name]) and MATERIALS not in names
        yield MATERIALS if unknown else name, np.concatenate([np.asarray(runs[i]) for i in rows])


def _numbers(named: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Give those that are numbers, each in one of the usual types and in rows."""
    for name, array in named:
        values = np.asarray(array)
        kind = {"b": "u1", "f2": "f4", "f16": "f8"}
        dtype = kind.get(values.dtype.str[1:]) or kind.get(values.dtype.kind) or values.dtype
        if values.dtype.kind == "u" and values.size and values.max() > np.iinfo(np.int64).max:
            dtype = "f8"  # not all readers have a type for such
        if values.dtype.kind in "biuf" and values.size:
            values = values.astype(dtype, copy=False)
            yield name, values if values.ndim == 1 else values.reshape(len(values), -1)


def _marked(sizes: list[int], runs: list[NDArray[np.int64]]) -> NDArray[np.uint8]:
    """Mark some rows of each run."""
    marks = [np.zeros(size, dtype=np.uint8) for size in sizes]
    for mark, rows in zip(marks, runs, strict=True):
        mark[rows] = 1
    return np.concatenate([*marks, np.empty(0, dtype=np.uint8)])


def _with(arrays: dict[str, NDArray[Any]], masks: Mapping[str, NDArray[np.uint8]]) -> dict[str, NDArray[Any]]:
    """Add the marks of sets to data, of which one may mark the same, or be called the same."""
    for name, mask in masks.items():
        known = arrays.get(name)
        if known is None or known.dtype != np.uint8 or not np.array_equal(known, mask):
            arrays[name if known is None else f"{name} (set)"] = mask
    return arrays
