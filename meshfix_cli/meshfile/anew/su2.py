"""SU2's .su2 files: points, the elements of their dimension, and facets by the markers that these are in.

Source: SU2 documentation, "Mesh File".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import ELEMENTS, dimension_of, words
from meshfix_cli.meshfile.anew.content import Content, words_of
from meshfix_cli.meshfile.anew.gmsh_groups import groups_of
from meshfix_cli.meshfile.anew.tables import integers, reals
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Cells

_TYPES = {key: element.vtk for key, element in ELEMENTS.items() if element.linear and element.shape.corners > 1}
_REST = "unmarked"  # facets that are in no group


def written(content: Content, _: Format) -> bytes:
    """Return a file of one zone; groups of elements have no place in it, and a facet is in one marker."""
    points = np.asarray(content.points, dtype=np.float64)
    if points.shape[1] == 3 and content.dimension == 2 and not points[:, 2].any():
        points = points[:, :2]
    dimension = points.shape[1]
    if content.dimension < dimension:
        plural = words(next(run.type for run in content.cells if dimension_of(run.type) == content.dimension))[1]
        raise WriteError(f"cannot be written as su2: that holds no {plural} in space")
    cells = [run for run in content.cells if run.type in _TYPES and dimension_of(run.type) == dimension]
    parts = [f"NDIME= {dimension}\nNELEM= {sum(len(run.vertices) for run in cells)}\n".encode()]
    parts += [_elements(run, slice(None)) for run in cells]
    parts += [f"NPOIN= {len(points)}\n".encode(), reals(points)]
    markers = _markers(content, dimension - 1)
    parts.append(f"NMARK= {len(markers)}\n".encode())
    called = words_of([*markers], "A-Za-z0-9_.+-")
    for name, facets in markers.items():
        count = sum(len(rows) for _, rows in facets)
        parts.append(f"MARKER_TAG= {called[name]}\nMARKER_ELEMS= {count}\n".encode())
        parts += [_elements(run, rows) for run, rows in facets]
    return b"".join(parts)


def _elements(run: Cells, rows: NDArray[np.int64] | slice) -> bytes:
    """Return lines of the type and the vertices."""
    vertices = run.vertices[rows]
    return integers(np.full(len(vertices), _TYPES[run.type]), vertices)


def _markers(content: Content, dimension: int) -> dict[str, Sequence[tuple[Cells, NDArray[np.int64]]]]:
    """Return the facets of each group, by its name or, where it has none, by its number; those of none come last."""
    groups = groups_of(content, several=False)
    names = {number: name for d, number, name in reversed(groups.titles) if d == dimension}
    found: dict[str, list[tuple[Cells, NDArray[np.int64]]]] = {}
    for run, numbers in zip(content.cells, groups.physical, strict=True):
        if run.type in _TYPES and dimension_of(run.type) == dimension:
            for number in np.unique(numbers).tolist():
                name = names.get(number, str(number) if number else _REST)
                found.setdefault(name, []).append((run, np.flatnonzero(numbers == number)))
    return dict(sorted(found.items(), key=lambda item: item[0] == _REST))
