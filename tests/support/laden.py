"""Meshes with all that a file may hold: named materials and facets, sets that overlap, sets of points, data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from building import Blocks
from elements import MESHES
from refined import COMPLETE, SERENDIPITY, refined

from meshfix_cli import read, write
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.document import Document, build
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source

TYPES: dict[str, dict[str, str] | None] = {"linear": None, "serendipity": SERENDIPITY, "complete": COMPLETE}
FACETS = {3: "triangle", 4: "quad"}


def boundary(points: Any, blocks: Blocks) -> Blocks:
    """The facets of solids that belong to one of them and lie at the least x."""
    found: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for key, rows in blocks:
        for row in rows.tolist():
            for facet in ELEMENTS[key].shape.facets:
                corners = tuple(row[i] for i in facet)
                found.setdefault(tuple(sorted(corners)), []).append(corners)
    left = points[:, 0].min()
    here = [one[0] for one in found.values() if len(one) == 1 and (points[list(one[0])][:, 0] < left + 1e-9).all()]
    tables = [(FACETS[k], [one for one in here if len(one) == k]) for k in (3, 4)]
    return [(key, np.array(rows, dtype=np.int32)) for key, rows in tables if rows]


def laden(kind: str = "linear", name: str = "every solid") -> Source:
    """Return a mesh of elements of every type."""
    points, blocks = MESHES[name]()
    points = np.asarray(points, dtype=np.float64)
    walls = boundary(points, blocks) if points.shape[1] == 3 else []
    blocks, solids = [*blocks, *walls], len(blocks)
    types = TYPES[kind]
    if types is not None:
        wanted = {key: types.get(key, key) for key, _ in blocks}
        points, blocks = refined(points, blocks, wanted)
    centres = [points[rows].mean(axis=1) for _, rows in blocks]
    middle = np.median(np.concatenate(centres)[:, 0])
    labels = [np.where(at[:, 0] < middle, 1, 2) if i < solids else np.full(len(at), 7) for i, at in enumerate(centres)]
    probe = [np.flatnonzero(np.abs(at[:, 1] - points[:, 1].mean()) < 0.3 * np.ptp(points[:, 1])) for at in centres]
    used = np.unique(np.concatenate([rows.ravel() for _, rows in blocks]))
    arrays = Arrays(
        point={"temperature": np.cos(points[:, 0]) / 3, "velocity": np.sin(points @ np.ones((points.shape[1], 3)) / 7)},
        cell={
            "gmsh:physical": labels, "quality": [np.tan(at[:, 1]) / 3 for at in centres],
        },
        groups={
            "steel": np.array([1, points.shape[1]]), "copper": np.array([2, points.shape[1]]),
            **({"hot_wall": np.array([7, 2])} if walls else {}),
        },
        point_sets={"clamped": used[::3]},
        cell_sets={"probe": [one if i < solids else one[:0] for i, one in enumerate(probe)]},
    )  # fmt: skip
    cells = [Cells(key, rows.astype(np.int64)) for key, rows in blocks]
    return Source(points, cells, load=lambda: arrays, regions=("gmsh:physical",))


def document_of(source: Source) -> Document:
    """Return what is written."""
    return build("laden", source, Format("memory"), (), None)


def members(source: Source) -> dict[str, tuple[set[Any], set[Any]]]:
    """The places of the points, and those of the corners of each cell, of each group; cells by their dimension."""
    points = np.asarray(source.points, dtype=np.float64)
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    places = list(map(tuple, (points.round(9) + 0.0).tolist()))
    found = {}
    for name, group in groups_of(source).items():
        cells = {
            (run.type, *sorted(places[i] for i in row))
            for run, rows in group.cells
            for row in run.vertices[rows].tolist()
        }
        found[name] = ({places[i] for i in group.nodes.tolist()}, cells)
    return found


def with_numbers(source: Source) -> Source:
    """Give numbers to nodes and elements that tell more than their order does."""
    rng = np.random.default_rng(0)
    nodes, count = 7 * rng.permutation(len(source.points)) + 10**6, sum(len(run.vertices) for run in source.cells)
    ids = np.split(3 * rng.permutation(count) + 11, np.cumsum([len(run.vertices) for run in source.cells])[:-1])
    cells = [replace(run, ids=mine) for run, mine in zip(source.cells, ids, strict=True)]
    return replace(source, cells=cells, numbers=lambda: nodes)


def places(source: Source) -> list[tuple[float, ...]]:
    rounded = np.asarray(source.points, dtype=np.float64).round(5) + 0.0
    return list(map(tuple, rounded.tolist()))


def nodes_of(source: Source) -> dict[tuple[float, ...], int]:
    """The numbers of nodes by their places."""
    numbers = source.numbers()
    return {} if numbers is None else dict(zip(places(source), numbers.tolist(), strict=True))


def elements_of(source: Source) -> dict[tuple[Any, ...], int]:
    """The numbers of elements by their corners."""
    at, found = places(source), dict[tuple[Any, ...], int]()
    for run in source.cells:
        for row, number in zip(run.vertices.tolist(), [] if run.ids is None else run.ids.tolist(), strict=False):
            found[(run.type, *sorted(at[i] for i in row))] = number
    return found


def box(nodes: Sequence[int] | None = None, *ids: Sequence[int] | None, arrays: Arrays | None = None) -> Source:
    """Two tetrahedra and two of their facets."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    tables = {"tetra": [[0, 1, 2, 3], [1, 2, 3, 4]], "triangle": [[0, 2, 1], [0, 1, 3]]}
    cells = [
        Cells(key, np.array(rows), None if mine is None else np.array(mine))
        for (key, rows), mine in zip(tables.items(), ids or (None, None), strict=True)
    ]
    return Source(
        points, cells, load=lambda: arrays or Arrays(), numbers=lambda: None if nodes is None else np.array(nodes)
    )


def written(source: Source, form: Format, path: Path) -> tuple[Source, tuple[str, ...]]:
    """A source as it is read again, and what was dropped."""
    document = build("in", source, Format("memory"), (), None)
    _, dropped = write(document, document.mesh, path, form)
    return read(path).source, dropped
