"""MED files: nodes in the order of the table of elements, families, groups and fields, and what is refused."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_med import ANY_PROFILE, FILES, STEP, read_independently, salome
from files_medit import interior, material, surface
from programs import gmsh_session
from shapes import block, plate

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.med import ORDER, parse

h5py = pytest.importorskip("h5py")
MESH = f"ENS_MAA/skin of it/{STEP}"


def made(name: str, folder: Path) -> bytes:
    FILES[name](folder / name)
    return (folder / name).read_bytes()


def edited(data: bytes, edit: Callable[[Any], None]) -> bytes:
    stream = io.BytesIO(data)
    with h5py.File(stream, "r+") as file:
        edit(file)
    return stream.getvalue()


def of_salome(folder: Path, edit: Callable[[Any], None]) -> bytes:
    return edited(made("salome.med", folder), edit)


@pytest.mark.parametrize("name", FILES)
def test_points_and_cells_are_those_of_the_other_reader(name: str, tmp_path: Path) -> None:
    source = parse(made(name, tmp_path))
    points, rest = read_independently(tmp_path / name)
    np.testing.assert_array_equal(source.points, points[:, : source.points.shape[1]])
    for kind, run in zip(sorted(path[-3:] for path in rest if path[-7:-3] == "MAI/"), source.cells, strict=True):
        rows = next(values for path, values in rest.items() if path.endswith(f"{kind}/NOD "))
        order = [0, 2, 1, 3] if run.type == "tetra" else range(run.vertices.shape[1])
        np.testing.assert_array_equal(run.vertices, rows.reshape(-1, len(run.vertices)).T[:, order] - 1)


@pytest.mark.parametrize("key", [*ORDER, "triangle6", "quad", "quad8", "quad9", "line3", "vertex"])
def test_nodes_stand_where_vtk_has_them(key: str, tmp_path: Path) -> None:
    """Straight elements of gmsh: VTK tells where its nodes are between the corners."""
    types = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    element = ELEMENTS[key]
    with gmsh_session(SaveAll=1) as gmsh:
        _, d, _, count, local, corners = gmsh.model.mesh.getElementProperties(element.gmsh)
        points = np.column_stack([np.reshape(local, (count, -1))[:, :d], np.zeros((count, 3 - d))]) * 1.0
        gmsh.model.addDiscreteEntity(d, 1)
        gmsh.model.mesh.addNodes(d, 1, np.arange(count) + 1, points.ravel())
        gmsh.model.mesh.addElementsByType(1, element.gmsh, [], np.arange(count) + 1)
        gmsh.write(str(tmp_path / "one.med"))
    source = parse((tmp_path / "one.med").read_bytes())
    assert [run.type for run in source.cells] == [key]
    found = source.points[source.cells[0].vertices[0]]
    vtk = types.vtkGenericCell()
    vtk.SetCellType(element.vtk)
    inside = np.reshape([vtk.GetParametricCoords()[i] for i in range(3 * count)], (count, 3)) if d else np.zeros((1, 3))
    linear = types.vtkGenericCell()
    linear.SetCellType(next(one.vtk for one in ELEMENTS.values() if one.shape is element.shape and one.linear))
    expected, weights = [], [0.0] * corners
    for place in inside.tolist():
        linear.InterpolateFunctions(place, weights)
        expected.append(np.array(weights) @ found[:corners])
    np.testing.assert_allclose(found, expected, atol=1e-12)
    if d == 3:
        a, b, c = (found[i] - found[0] for i in element.shape.simplices[0][1:])
        assert np.dot(np.cross(a, b), c) > 0


def test_groups_are_sets_and_families_are_regions(tmp_path: Path) -> None:
    source = parse(made("salome.med", tmp_path))
    points, cells = block()
    skin = surface(cells)
    arrays = source.arrays
    assert sorted(arrays.point_sets) == ["wall"]
    np.testing.assert_array_equal(arrays.point_sets["wall"], np.unique(skin))
    assert sorted(arrays.cell_sets) == ["all of the skin, \xe9t\xe9", "even", "material"]
    tetra, triangle = ([run.type for run in source.cells].index(key) for key in ("tetra", "triangle"))
    assert arrays.cell_sets["even"][triangle].tolist() == list(range(0, len(skin), 2))
    assert arrays.cell_sets["all of the skin, \xe9t\xe9"][triangle].tolist() == list(range(len(skin)))
    np.testing.assert_array_equal(arrays.cell_sets["material"][tetra], np.flatnonzero(material(points, cells) == 1))
    assert len(arrays.cell_sets["material"][triangle]) == 0
    np.testing.assert_array_equal(source.cells[tetra].ids, np.arange(len(cells)) + 1001)
    assert source.regions == ("cell_tags",)
    assert source.untold == ("fields velocity",)


def test_the_interface_of_families_is_held(tmp_path: Path) -> None:
    points, cells = block()
    upper = points[cells].mean(axis=1)[:, 2] > 0.7
    document = read_edited(tmp_path, lambda mesh: mesh["MAI/TE4/FAM"].write_direct(np.where(upper, -3, -4)))
    shared = np.intersect1d(cells[upper], cells[~upper])
    inner = np.intersect1d(shared, interior(points, cells))
    assert len(inner) > 3
    assert document.fixed["between regions of cell_tags"] == len(inner)


def read_edited(folder: Path, edit: Callable[[Any], None]) -> Any:
    data = of_salome(folder, lambda file: edit(file[MESH]))
    (folder / "edited.med").write_bytes(data)
    return read(folder / "edited.med")


def test_fields_are_data_of_points_and_cells(tmp_path: Path) -> None:
    source = parse(made("meshio.med", tmp_path))
    points, cells = block()
    np.testing.assert_array_equal(source.arrays.point["T"], points.sum(axis=1))
    tetra = [run.type for run in source.cells].index("tetra")
    np.testing.assert_array_equal(source.arrays.cell["pressure"][tetra], np.arange(len(cells)) / 4)
    np.testing.assert_array_equal(source.arrays.point["point_tags"], np.arange(len(points)) % 3)
    only = edited((tmp_path / "meshio.med").read_bytes(), _without_triangles)
    values = parse(only).arrays.cell["pressure"]
    assert np.isnan(values[1 - tetra]).all()
    np.testing.assert_array_equal(values[tetra], np.arange(len(cells)) / 4)


def _without_triangles(file: Any) -> None:
    field = file["CHA/pressure"]
    del field[f"{next(iter(field))}/MAI.TR3"]


def test_compressed_coordinates_are_repaired(tmp_path: Path) -> None:
    def compress(file: Any) -> None:
        for path in (f"{MESH}/NOE/COO", f"{MESH}/MAI/TE4/NOD"):
            values, number = file[path][()], file[path].attrs["NBR"]
            del file[path]
            file.create_dataset(path, data=values, compression="gzip").attrs["NBR"] = number

    (tmp_path / "in.med").write_bytes(of_salome(tmp_path, compress))
    document = read(tmp_path / "in.med")
    outcome = untangle(document.mesh)
    assert outcome.valid
    write(document, outcome.after, tmp_path / "out.med")
    before, others = read_independently(tmp_path / "in.med")
    after, others_after = read_independently(tmp_path / "out.med")
    np.testing.assert_equal(others_after, others)
    np.testing.assert_array_equal(after, document.file_points(outcome.after))
    assert (after != before).any()
    write(document, document.mesh, tmp_path / "same.med")
    assert (tmp_path / "same.med").read_bytes() == (tmp_path / "in.med").read_bytes()


def test_polygons_and_polyhedra_are_held(tmp_path: Path) -> None:
    def add(file: Any) -> None:
        types = file[f"{MESH}/MAI"]
        types.create_group("POG")["NOD"] = [1, 2, 3, 4, 5, 2, 3, 4]
        types["POG/INN"] = [1, 6, 9]
        types.create_group("POE")["NOD"] = [5, 6, 7, 7, 6, 8, 5, 7, 8, 8, 6, 5]
        types["POE/IFN"] = [1, 4, 7, 10, 13]
        types["POE/INN"] = [1, 5]

    source = parse(of_salome(tmp_path, add))
    runs = {run.type: [row.tolist() for row in run.vertices] for run in source.cells}
    assert runs["polygon"] == [[0, 1, 2, 3, 4], [1, 2, 3]]
    assert runs["polyhedron"] == [[4, 5, 6, 6, 5, 7, 4, 6, 7, 7, 5, 4]]
    (tmp_path / "in.med").write_bytes(of_salome(tmp_path, add))
    assert read(tmp_path / "in.med").not_judged == {"polyhedron": 1}
    for index in ([0, 5], [1, 6], [5, 1], []):

        def damage(file: Any, index: list[int] = index) -> None:
            add(file)
            del file[f"{MESH}/MAI/POE/INN"]
            file[f"{MESH}/MAI/POE/INN"] = np.array(index, dtype=int)

        with pytest.raises(ReadError, match=r"INN of its .* is damaged"):
            parse(of_salome(tmp_path, damage))


def test_what_is_written_as_med_is_right_for_gmsh(tmp_path: Path) -> None:
    (tmp_path / "in.med").write_bytes(made("salome.med", tmp_path))
    document = read(tmp_path / "in.med")
    outcome = untangle(document.mesh)
    write(document, outcome.after, tmp_path / "plain.vtu")
    other = read(tmp_path / "plain.vtu")
    write(other, other.mesh, tmp_path / "back.med")
    with gmsh_session() as gmsh:
        gmsh.merge(str(tmp_path / "back.med"))
        tags = gmsh.model.mesh.getElementsByType(4)[0]
        assert min(gmsh.model.mesh.getElementQualities(tags, "minDetJac")) > 0
    np.testing.assert_array_equal(read(tmp_path / "back.med").mesh.points, outcome.after.points)


def _second_mesh(file: Any) -> None:
    file.copy("ENS_MAA/skin of it", file["ENS_MAA"], name="other")


def _second_step(file: Any) -> None:
    file.copy(MESH, file["ENS_MAA/skin of it"], name="0000000000000000000100000000000000000001")


def _structured(file: Any) -> None:
    file["ENS_MAA/skin of it"].attrs["TYP"] = 1


def _too_many(file: Any) -> None:
    file[f"{MESH}/NOE/COO"].attrs["NBR"] = 10**12


def _no_number(file: Any) -> None:
    file[f"{MESH}/MAI/TE4/NOD"].attrs["NBR"] = "many"


def _fewer(file: Any) -> None:
    file[f"{MESH}/MAI/TE4/NOD"].attrs["NBR"] = 3


def _short_families(file: Any) -> None:
    del file[f"{MESH}/MAI/TE4/FAM"]
    file[f"{MESH}/MAI/TE4/FAM"] = [1, 2]


def _by_faces(file: Any) -> None:
    del file[f"{MESH}/MAI/TE4/NOD"]


def _real(file: Any) -> None:
    number = file[f"{MESH}/MAI/TE4/NOD"].attrs["NBR"]
    values = file[f"{MESH}/MAI/TE4/NOD"][()] * 1.0
    del file[f"{MESH}/MAI/TE4/NOD"]
    file.create_dataset(f"{MESH}/MAI/TE4/NOD", data=values).attrs["NBR"] = number


def _no_mesh(file: Any) -> None:
    del file["ENS_MAA/skin of it"]


def _no_points(file: Any) -> None:
    del file[f"{MESH}/NOE/COO"]


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (_second_mesh, r"holds several meshes \(other, skin of it\), and one mesh is read"),
        (_second_step, "holds several steps of its mesh"),
        (_structured, "holds a structured mesh"),
        (_too_many, r"its .*COO has 615 numbers for 1,000,000,000,000"),
        (_no_number, "the NBR of its .*NOD is 'many'"),
        (_fewer, "its .*NOD has 2,304 numbers for 3"),
        (_short_families, "its .*FAM has 2 numbers for 576"),
        (_by_faces, "its cells 'TE4' are not described by their nodes"),
        (_real, "does not hold integers"),
        (_no_mesh, "there is no mesh in it"),
        (_no_points, "has no coordinates"),
    ],
)
def test_malformed(edit: Callable[[Any], None], message: str, tmp_path: Path) -> None:
    (tmp_path / "broken.med").write_bytes(of_salome(tmp_path, edit))
    with pytest.raises(ReadError, match=message):
        read(tmp_path / "broken.med")


def test_truncated(tmp_path: Path) -> None:
    salome(tmp_path / "whole.med")
    data = (tmp_path / "whole.med").read_bytes()
    for cut in range(9, len(data), len(data) // 40):
        with pytest.raises(ReadError):
            parse(data[:cut])


def test_an_old_file_has_no_steps(tmp_path: Path) -> None:
    source = parse(made("old.med", tmp_path))
    assert list(source.arrays.cell_sets) == ["edge"]
    np.testing.assert_array_equal(source.cells[1].vertices, plate()[1])
    assert ANY_PROFILE.encode() not in (tmp_path / "old.med").read_bytes()
