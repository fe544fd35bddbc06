"""The cells that the legacy and the XML files of VTK share."""

from __future__ import annotations

import numpy as np
import pytest

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.vtk.cells import TYPES, runs


def test_names_and_sizes_are_those_of_meshio() -> None:
    from meshio._common import num_nodes_per_cell
    from meshio._vtk_common import vtk_to_meshio_type

    own = {36, 41}
    for number, name in vtk_to_meshio_type.items():
        assert TYPES[number][0] == name
        assert TYPES[number][1] == num_nodes_per_cell.get(name, TYPES[number][1])
    assert own <= TYPES.keys()


def test_sizes_are_those_of_vtk() -> None:
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    for number, (name, size) in TYPES.items():
        cell = model.vtkGenericCell.InstantiateCell(number)
        assert cell is None or size in (0, cell.GetNumberOfPoints()), name


def test_runs_are_in_the_order_of_the_file_and_cut_where_type_or_size_changes() -> None:
    types = np.array([5, 5, 9, 5, 7, 7, 0, 99])
    offsets = np.array([0, 3, 6, 10, 13, 18, 22, 22, 24])
    found = runs(types, offsets, np.arange(24) + 100)
    assert [(run.type, run.rows.tolist(), run.vertices.shape) for run in found] == [
        ("triangle", [0, 1], (2, 3)), ("quad", [2], (1, 4)), ("triangle", [3], (1, 3)), ("polygon", [4], (1, 5)),
        ("quad", [5], (1, 4)), ("empty", [6], (1, 0)), ("vtk99", [7], (1, 2)),
    ]  # fmt: skip
    assert np.concatenate([run.vertices.ravel() for run in found]).tolist() == list(range(100, 124))
    assert found[1].cells.ids is not None
    assert found[1].cells.ids.tolist() == [2]


def test_very_many_runs_are_gathered_by_type() -> None:
    types = np.tile([10, 5, 10], 2000)
    sizes = np.where(types == 10, 4, 3)
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    found = runs(types, offsets, np.arange(offsets[-1]))
    assert sorted(run.type for run in found) == ["tetra", "triangle"]
    for run in found:
        np.testing.assert_array_equal(run.vertices[:, 0], offsets[run.rows])
        assert (np.diff(run.rows) > 0).all()


def test_wedges_are_what_vtk_computes_with() -> None:
    """Its documentation has had the other orientation, which meshio writes; its volumes and determinants have this."""
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    wedge = model.vtkWedge()
    places = np.reshape([wedge.GetParametricCoords()[i] for i in range(18)], (6, 3))
    (run,) = runs(np.array([13]), np.array([0, 6]), np.arange(6))
    for row in ELEMENTS[run.type].shape.simplices:
        p = places[run.vertices[0][list(row)]]
        assert np.linalg.det(p[1:] - p[0]) > 0


def test_no_cells() -> None:
    none = np.empty(0, dtype=np.int64)
    assert runs(none, np.zeros(1, dtype=np.int64), none) == []


@pytest.mark.parametrize(
    ("types", "offsets", "message"),
    [
        ([5, 5], [0, 3, 7], "do not fit"),
        ([5, 5], [0, 4, 3], "do not fit"),
        ([5, 5], [-3, 0, 3], "do not fit"),
        ([5], [0, 3, 6], "do not fit"),
        ([10, 5], [0, 3, 6], "a tetra with 3 vertices"),
    ],
)
def test_what_does_not_fit_is_refused(types: list[int], offsets: list[int], message: str) -> None:
    with pytest.raises(ReadError, match=message):
        runs(np.array(types), np.array(offsets), np.arange(6))
