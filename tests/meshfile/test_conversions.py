"""From each of the common formats to each other: what both hold arrives, and all else is named as dropped."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from itertools import permutations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from laden import document_of, elements_of, laden, nodes_of, places, with_numbers

from meshfix_cli import read, write
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Source

CELLS, POINTS, POINT_DATA, CELL_DATA = "sets of cells", "sets of points", "point data", "cell data"
REGIONS, NAMES, FACETS, NUMBERS = "regions", "names of regions", "facets", "numbers of nodes and elements"
ALL = frozenset({REGIONS, NAMES, FACETS, CELLS, POINTS, POINT_DATA, CELL_DATA})
GROUPS = {"steel": NAMES, "copper": NAMES, "hot_wall": FACETS, "probe": CELLS, "clamped": POINTS}


@dataclass(frozen=True)
class Held:
    """What a format holds, as its writer and its reader have it: Nastran's sets, for one, have numbers for names."""

    form: Format
    suffix: str
    what: frozenset[str] = ALL


FORMATS = {
    "vtu": Held(Format("vtu", True), ".vtu"),
    "vtk": Held(Format("vtk", False), ".vtk"),
    "xdmf": Held(Format("xdmf"), ".xdmf"),
    "exodus": Held(Format("exodus"), ".e", ALL | {NUMBERS}),
    "gmsh22": Held(Format("gmsh22", False), ".msh", (ALL | {NUMBERS}) - {CELLS, POINTS}),
    "gmsh": Held(Format("gmsh", True), ".msh", (ALL | {NUMBERS}) - {POINTS}),
    "abaqus": Held(Format("abaqus"), ".inp", (ALL | {NUMBERS}) - {POINT_DATA, CELL_DATA}),
    "medit": Held(Format("medit"), ".mesh", frozenset({REGIONS})),
    "su2": Held(Format("su2"), ".su2", frozenset({FACETS})),
    "nastran": Held(Format("nastran"), ".bdf", frozenset({REGIONS, NUMBERS})),
}


@cache
def made(name: str) -> bytes:
    """A laden mesh in a format."""
    held = FORMATS[name]
    with TemporaryDirectory() as folder:
        document = document_of(with_numbers(laden()))
        write(document, document.mesh, Path(folder) / f"in{held.suffix}", held.form)
        return (Path(folder) / f"in{held.suffix}").read_bytes()


def solids(source: Source) -> set[tuple[Any, ...]]:
    at = places(source)
    return {(run.type, *sorted(at[i] for i in row)) for run in source.cells for row in run.vertices.tolist()}


def materials(source: Source) -> set[frozenset[tuple[Any, ...]]]:
    """The elements of each region, by their corners."""
    at, found = places(source), dict[tuple[Any, ...], set[tuple[Any, ...]]]()
    regions = source.regions[:1]
    for i, run in enumerate(source.cells):
        if run.type in ("triangle", "quad"):
            continue
        for k, row in enumerate(run.vertices.tolist()):
            label = tuple(float(source.arrays.cell[name][i][k]) for name in regions)
            found.setdefault(label, set()).add((run.type, *sorted(at[j] for j in row)))
    return {frozenset(cells) for cells in found.values()}


def are_parts(after: Any, before: Any, finer_before: bool, finer_after: bool) -> bool:
    """Whether regions are the same; in gmsh's 4.1 those of overlapping groups are the parts of these."""
    if not (finer_before or finer_after):
        return bool(after == before)
    coarse, fine = (after, before) if finer_before else (before, after)
    return all(sum(part <= whole for whole in coarse) == 1 for part in fine)


def points_of(source: Source, name: str) -> set[tuple[float, ...]]:
    at = places(source)
    return {at[i] for i in groups_of(source)[name].points.tolist()}


@pytest.mark.parametrize(("one", "other"), list(permutations(FORMATS, 2)))
def test_what_both_hold_arrives(one: str, other: str, tmp_path: Path) -> None:
    first, second = FORMATS[one], FORMATS[other]
    path, target = tmp_path / f"in{first.suffix}", tmp_path / f"out{second.suffix}"
    path.write_bytes(made(one))
    document = read(path)
    _, dropped = write(document, document.mesh, target, second.form)
    before, after = document.source, read(target).source
    assert not after.arrays.unread
    assert {cell for cell in solids(before) if not cell[0].startswith(("tri", "quad"))} <= solids(after)
    if {REGIONS} <= first.what & second.what:
        assert are_parts(materials(after), materials(before), one == "gmsh", other == "gmsh")
    groups, found = groups_of(before), groups_of(after)
    for name, kind in GROUPS.items():
        if name not in groups:
            assert kind not in first.what, name
        elif kind in second.what:
            assert points_of(after, name) == points_of(before, name)
        else:
            assert name in found or f"group {name}" in dropped
    before = before.in_order() if NUMBERS in first.what & second.what else before
    nodes, elements = nodes_of(after), elements_of(after)
    if NUMBERS in first.what & second.what:
        assert nodes == nodes_of(before)
        assert elements.items() <= elements_of(before).items() and len(elements) == len(solids(after))
    assert ("numbers of nodes" in dropped) == (NUMBERS in first.what - second.what)
    assert ("numbers of elements" in dropped) == (NUMBERS in first.what - second.what)
    data = {f"point data {name}": values for name, values in before.arrays.point.items()}
    data |= {f"cell data {name}": np.concatenate(runs) for name, runs in before.arrays.cell.items()}
    in_order = after.in_order().merged()
    there = [*in_order.arrays.point.values(), *(np.concatenate(runs) for runs in in_order.arrays.cell.values())]
    for title, values in data.items():
        some = values != 0 if title.removeprefix("cell data ") in before.regions else slice(None)  # 0: of no region
        alike = [one for one in there if one.shape == values.shape]
        arrived = any(np.allclose(one[some], values[some], 1e-6) for one in alike)
        assert arrived or title in dropped
    for kind, title in ((POINT_DATA, "temperature"), (POINT_DATA, "velocity"), (CELL_DATA, "quality")):
        if kind in first.what & second.what:
            assert f"{kind} {title}" in data and f"{kind} {title}" not in dropped
    if first.what >= ALL <= second.what:
        assert not [what for what in dropped if re.match("group|point data|cell data", what)]
