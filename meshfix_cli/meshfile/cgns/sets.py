"""Boundary conditions, sections and families of a CGNS file, by their names.

Source: CGNS, "Standard Interface Data Structures", sections 9.3, 12.1 and 12.6.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.cgns.types import Int64
from meshfix_cli.meshfile.cgns.zones import Run, Zone, child, children, grid, integers, text
from meshfix_cli.meshfile.source import Arrays

FAMILY = "cgns:family"
_FACES = {"IFaceCenter": 0, "JFaceCenter": 1, "KFaceCenter": 2}


def arrays(zones: Sequence[Zone], rows: Int64) -> Arrays:
    """Return families as regions, boundary conditions as sets of points, and sections as sets of cells.

    What is said of cells of the highest dimension in the way of a boundary condition is a family of these.

    Parameters
    ----------
    rows : (k,) int64
        For the points of all zones which points of the mesh they are.
    """
    runs = [run for zone in zones for run in zone.runs]
    highest = max(dimension_of(run.type) for run in runs if len(run.ids))
    families = [np.full(len(run.ids), zone.family, dtype=object) for zone in zones for run in zone.runs]
    points: dict[str, Int64] = {}
    start = before = 0
    for zone in zones:
        for names, node in _conditions(zone):
            chosen = _elements(zone, node)
            inside = [i for i, run in enumerate(zone.runs) if chosen and dimension_of(run.type) == highest]
            if any(chosen[i].any() for i in inside):
                for i in inside:
                    families[before + i][chosen[i]] = names[-1]
                continue
            mine = start + named_points(zone, node, names[0])
            for name in names:
                points[name] = np.union1d(points.get(name, mine[:0]), rows[mine])
        start, before = start + zone.points, before + len(zone.runs)
    solved = [i for i, run in enumerate(runs) if dimension_of(run.type) == highest]
    known = list(dict.fromkeys(name for i in solved for name in dict.fromkeys(families[i].tolist())))
    cell, groups = {}, {}
    if len(known) > 1:
        numbers = {name: number for number, name in enumerate(known, 1)}
        cell[FAMILY] = [np.array([numbers.get(name, 0) for name in some.tolist()], np.int64) for some in families]
        groups = {name: [number, highest] for name, number in numbers.items() if name}
    return Arrays(cell=cell, groups=groups, point_sets=points, cell_sets=_sections(runs))


def named_points(zone: Zone, node: Any, name: str) -> Int64:
    """Return the rows of the points that a condition or an interface names, or of the cells and faces that it does."""
    chosen = _elements(zone, node)
    return _vertices(zone, chosen) if chosen else _points(zone, node, name)


def _sections(runs: Sequence[Run]) -> dict[str, list[Int64]]:
    names = dict.fromkeys(run.section for run in runs if run.section)
    return {name: [np.arange(len(run.ids) if run.section == name else 0) for run in runs] for name in names}


def _conditions(zone: Zone) -> Iterator[tuple[list[str], Any]]:
    """Give the boundary conditions, each with its name and that of its family."""
    for table in children(zone.group, "ZoneBC_t").values():
        for name, node in children(table, "BC_t").items():
            family = text(child(node, "FamilyName_t"))
            yield list(dict.fromkeys([name, family or name])), node


def _elements(zone: Zone, node: Any) -> list[NDArray[np.bool_]]:
    """Return which cells of each run a condition names; none where it names points."""
    for which in ("Element", "Point"):
        bounds = integers(child(node, "IndexRange_t", f"{which}Range"))
        listed = integers(child(node, "IndexArray_t", f"{which}List"))
        of_cells = which == "Element" or (location(node) != "Vertex" and not zone.structured)
        if of_cells and bounds.size:
            return [(run.ids >= bounds.min()) & (run.ids <= bounds.max()) for run in zone.runs]
        if of_cells and listed.size:
            return [np.isin(run.ids, listed) for run in zone.runs]
    return []


def _vertices(zone: Zone, chosen: Sequence[NDArray[np.bool_]]) -> Int64:
    found = [run.vertices[mask].ravel() for run, mask in zip(zone.runs, chosen, strict=True)]
    return np.unique(np.concatenate(found))


def location(node: Any) -> str:
    """Return of what a node names the indices."""
    return text(child(node, "GridLocation_t")) or "Vertex"


def _points(zone: Zone, node: Any, name: str) -> Int64:
    """Return the rows of the points of a condition."""
    bounds = integers(child(node, "IndexRange_t", "PointRange"))
    listed = integers(child(node, "IndexArray_t", "PointList"))
    d = len(zone.shape)
    if bounds.size not in (0, 2 * d) or listed.size % d:
        raise ReadError(f"is not a readable cgns file: the points of {name!r} have no indices of their zone")
    if not bounds.size:
        return _around(zone, listed.reshape(-1, d), location(node))
    ends = np.clip(np.sort(bounds.reshape(2, d), axis=0), 1, zone.shape)
    return _around(zone, grid(ends[0], ends[1]), location(node))


def _around(zone: Zone, indices: Int64, location: str) -> Int64:
    """Return points by their indices from 1, or those at the corners of the faces that have these."""
    if location == "Vertex":
        return np.unique(zone.rows(indices - 1))
    if location not in _FACES:  # of cells
        return np.empty(0, dtype=np.int64)
    steps = grid(np.zeros(len(zone.shape), np.int64), np.ones(len(zone.shape), np.int64))
    return np.unique(np.concatenate([zone.rows(indices - 1 + step) for step in steps if step[_FACES[location]] == 0]))
