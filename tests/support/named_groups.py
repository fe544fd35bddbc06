"""A mesh with all that a format may hold by name, to be written in each: materials, a boundary, sets, data."""

from __future__ import annotations

from pathlib import Path

import generate
import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.reading import parse
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.writing import _merged, _write_anew

MEMBERS = {"steel": 3, "copper": 3, "hot wall": 2, "both": 3, "corner": 0}  # names, and their dimensions
Cells3 = dict[str, NDArray[np.int64]]


def named() -> Source:
    """Tetrahedra of two materials, a wall of triangles, a set that cuts both materials, points of a corner, data."""
    points, tets = generate.bracket(0.5, 4)
    tets = tets.astype(np.int64)
    faces = np.concatenate([np.delete(tets, i, axis=1) for i in range(4)])
    _, first, times = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    wall = faces[first[times == 1]][:40]
    middles = points[tets].mean(axis=1)
    labels = [(middles[:, 0] > points[:, 0].mean()).astype(np.int64) + 1, np.full(len(wall), 7)]
    nothing = np.empty(0, dtype=np.int64)
    both = np.flatnonzero(middles[:, 1] > points[:, 1].mean())
    arrays = Arrays(
        point={"heat": np.sin(points[:, 0]) / 3, "load": points * np.pi},
        cell={"material": labels, "rate": [middles[:, 2] / 7, np.arange(len(wall)) / 9]},
        groups={"steel": np.array([1, 3]), "copper": np.array([2, 3]), "hot wall": np.array([7, 2])},
        point_sets={"corner": np.flatnonzero(points[:, 0] == points[:, 0].min())},
        cell_sets={"both": [both, nothing]},
    )
    return Source(points, [Cells("tetra", tets), Cells("triangle", wall)], load=lambda: arrays, regions=("material",))


def written_as(source: Source, form: Format, path: Path) -> tuple[Source, tuple[str, ...]]:
    """Write a source; return it as read again, and what was named as lost."""
    _, lost = _write_anew(path, _merged(source, form), source.points, form)
    return parse(path.read_bytes(), form, path), lost


def members(source: Source) -> dict[str, list[list[int]]]:
    """The cells of each group by their vertices, and its points."""
    found = {}
    for name, group in groups_of(source).items():
        cells = [np.sort(run.vertices[rows], axis=1).tolist() for run, rows in group.cells]
        found[name] = sorted([row for rows in cells for row in rows] + [[node] for node in group.nodes.tolist()])
    return found
