"""Nastran's bulk data: cards of fields, between commas or in columns of 8 or 16, which other lines may continue.

A card GRID has the number of a point, that of its coordinate system, and three coordinates, of which each is as long as
its columns allow; a card of an element its number, that of its property, and those of its points.

Source: MSC Software, "MSC Nastran Quick Reference Guide", sections "Format of Bulk Data Entries" and "Bulk Data
Entries"; Altair, "OptiStruct Reference Guide", section "Bulk Data Guidelines".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.nastran.cards import BLANK, Deck, Fields
from meshfix_cli.meshfile.nastran.elements import NAMES, REF, elements
from meshfix_cli.meshfile.nastran.sets import corners_of_systems, point_sets
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs

_CURVED = {"CORD1C": "cylindrical", "CORD2C": "cylindrical", "CORD1S": "spherical", "CORD2S": "spherical"}
_STRAIGHT = ("CORD1R", "CORD2R", "CORD3R")
_CUT = "the bulk data have no ENDDATA: if the file was cut short, elements are missing"
_TOLD = ("GRID", "ENDDATA", "SPC", "SPC1", *NAMES)


def parse(data: bytes) -> Source:
    """Read points and elements; those of rigid elements, of springs and of masses only hold their points."""
    deck = Deck.of(data)
    grids = deck.where("GRID")
    if not len(grids):
        raise ReadError("is not a readable nastran file: it has no GRID")
    numbers, systems = deck.integers(grids, 0, 2).T
    deck.check(grids, numbers != BLANK, "GRID has no number")
    coordinates, held = _coordinates(deck.fields(grids, 5, whole=True))
    numbering = Numbering(np.ascontiguousarray(numbers))
    runs = elements(deck, numbering)
    _check_systems(deck, runs, np.where(systems == BLANK, _default_system(deck), systems))
    held[corners_of_systems(deck, numbering)] = True
    arrays = runs.arrays(point_sets(deck, numbering))
    return Source(
        coordinates.read(data), runs.cells, InPlace(data, coordinates, runs.corners), lambda: arrays,
        (REF,) * (REF in arrays.cell), held, _untold(deck),
        numbers=lambda: numbering.numbers, notes=(_CUT,) * deck.cut,
    )  # fmt: skip


def _coordinates(grids: Fields) -> tuple[Places, NDArray[np.bool_]]:
    """Find the coordinates, and the points whose lines are too short to take others.

    Where the third are missing and 0, the mesh lies in a plane, and there is no use for them.
    """
    spans, widths = grids.columns(2, 5), grids.widths_of(2, 5)
    missing = spans[..., 0] < 0
    if missing[:, 2].any() and not Places.of_text(spans[:, 2:], "f8", 8, "free").read(grids.text).any():
        spans, widths, missing = spans[:, :2], widths[:, :2], missing[:, :2]
    lengths = spans[..., 1] - spans[..., 0]
    columns = np.flatnonzero(np.bincount(widths[~missing].ravel(), minlength=1)).tolist()
    longest = min((width for width in columns if width), default=16 if lengths.max() > 8 else 8)
    held: NDArray[np.bool_] = np.asarray(missing.any(axis=1))
    if len(columns) == 1:
        return Places.of_text(spans, "f8", longest, "padded" if columns[0] else "free"), held
    return Places(spans[..., 0], spans[..., 1], np.dtype("f8"), longest, "free", widths), held


def _default_system(deck: Deck) -> int:
    values = deck.integers(deck.where("GRDSET"), 1, 2)
    given = values[values != BLANK]
    return int(given[-1]) if len(given) else 0


def _check_systems(deck: Deck, runs: Runs, systems: Int64) -> None:
    """Raise ReadError where elements have points whose coordinates say little without their system."""
    if (systems != systems[0]).any():
        systems = systems[_used(runs.cells, len(systems))]
    used = np.unique(systems).tolist()
    if len(used) > 1:
        named = ", ".join(map(str, used))
        raise ReadError(f"has points in several coordinate systems ({named}), which meshfix does not compare")
    for number in used:
        if number <= 0:
            continue
        name = deck.system(number)
        if name in _CURVED:
            curved = f"{_CURVED[name]} system ({name} {number})"
            raise ReadError(f"has its points in a {curved}, which meshfix does not read")
        if name not in _STRAIGHT:
            raise ReadError(f"has its points in the coordinate system {number}, and does not define it")


def _used(cells: list[Cells], n: int) -> NDArray[np.bool_]:
    """Mark the points of the cells of the highest dimension, which alone are solved for."""
    used = np.zeros(n, dtype=bool)
    highest = max((dimension_of(run.type) for run in cells), default=0)
    for run in cells:
        if dimension_of(run.type) == highest:
            used[run.vertices[run.vertices >= 0]] = True
    return used


def _untold(deck: Deck) -> tuple[str, ...]:
    others = [name for name in deck.names if name and name not in _TOLD]
    return ("comments",) * (b"$" in deck.text) + ((f"cards {', '.join(others)}",) if others else ())
