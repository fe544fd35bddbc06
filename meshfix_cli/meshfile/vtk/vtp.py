"""VTK's XML files of polydata, .vtp, of one or several pieces; see `dataset`.

The cells of a piece are vertices, lines, polygons and strips of triangles, each in a section of its own, and the data
of cells have the rows of these one after the other; VTK counts the vertices of all pieces first, and so on.

Source: VTK, "vtkXMLPolyDataReader.cxx" and "vtkPolyData.h".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.vtk import dataset
from meshfix_cli.meshfile.vtk.cells import POLYDATA, types_of_sizes
from meshfix_cli.meshfile.vtk.dataset import Cells, DataSet, Piece
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile

_SECTIONS = {"Verts": "vertices", "Lines": "lines", "Polys": "polygons", "Strips": "triangle_strips"}


def parse(data: bytes) -> Source:
    """Read points and cells of all pieces."""
    return dataset.parse(data, _POLYDATA)


def promoted(data: bytes) -> bytes:
    """Return the file with coordinates in float64."""
    return dataset.promoted(data, _POLYDATA)


def _counts(piece: Element) -> tuple[int, int]:
    return piece.count("NumberOfPoints"), sum(_count(piece, section) for section in _SECTIONS)


def _count(piece: Element, section: str) -> int:
    name = f"NumberOf{section}"
    return piece.count(name) if name in piece.attributes else 0


def _cells(file: XmlFile, pieces: Sequence[Piece]) -> Cells:
    def types(_: Piece, section: str, sizes: NDArray[np.int64]) -> NDArray[np.int64]:
        return types_of_sizes(sizes, *POLYDATA[_SECTIONS[section].encode()])

    parts = [(piece, section, _count(piece.element, section)) for section in _SECTIONS for piece in pieces]
    found = dataset.listed(file, parts, types)
    return found if len(pieces) == 1 else found._replace(order=_order(pieces))


def _order(pieces: Sequence[Piece]) -> NDArray[np.int64]:
    """Return where the data of each cell stand among those of all pieces."""
    counts = np.array([[_count(piece.element, section) for section in _SECTIONS] for piece in pieces], dtype=np.int64)
    first = np.cumsum([0, *counts.ravel()])[:-1].reshape(counts.shape)
    parts = zip(first.T.ravel().tolist(), counts.T.ravel().tolist(), strict=True)
    return np.concatenate([np.arange(at, at + count) for at, count in parts] or [np.empty(0, dtype=np.int64)])


_POLYDATA = DataSet("PolyData", _counts, _cells)
