"""VTK's XML files of structured grids, .vts, of one piece; see `dataset`.

Points stand in rows along one, two or three indices, and cells between them. What has no coordinates for each point,
ImageData and rectilinear grids, is refused.

Source: VTK documentation, "VTK File Formats", section XML Formats.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.vtk import dataset
from meshfix_cli.meshfile.vtk.cells import in_rows, no_points
from meshfix_cli.meshfile.vtk.dataset import Cells, DataSet, Piece
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile

_WITHOUT_POINTS = re.compile(rb"<VTKFile[^>]*\stype\s*=\s*[\"']P?(ImageData|RectilinearGrid)")


def parse(data: bytes) -> Source:
    """Read points and cells."""
    if found := _WITHOUT_POINTS.search(data, 0, 4096):
        raise no_points(found[1].decode())
    return dataset.parse(data, _GRID)


def promoted(data: bytes) -> bytes:
    """Return the file with coordinates in float64."""
    return dataset.promoted(data, _GRID)


def _shape(piece: Element) -> list[int]:
    """Return how many points there are along each index."""
    text = piece.attributes.get("Extent", "")
    if not re.fullmatch(r"\s*(?:-?\d{1,9}\s+){5}-?\d{1,9}\s*", text):
        raise ReadError(f"is not a readable VTK file: the Extent of a Piece is {text!r}")
    ends = [int(word) for word in text.split()]
    return [max(last - first + 1, 0) for first, last in zip(ends[::2], ends[1::2], strict=True)]


def _counts(piece: Element) -> tuple[int, int]:
    shape = _shape(piece)
    cells = math.prod(n - 1 for n in shape if n > 1) if max(shape) > 1 and min(shape) else 0
    return math.prod(shape), cells


def _cells(_: XmlFile, pieces: Sequence[Piece]) -> Cells:
    if len(pieces) > 1:
        raise ReadError("holds a structured grid in several pieces, and one is read")
    found = in_rows(_shape(pieces[0].element)) if pieces else in_rows([])
    return Cells(*found, [])


_GRID = DataSet("StructuredGrid", _counts, _cells, oriented=False)
