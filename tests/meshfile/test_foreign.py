"""Files of other programs: named for what they are, numbered as they number, and nothing lost without a word."""

from __future__ import annotations

import time
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import error_line, run
from places import SAMPLES
from shapes import block, plate

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.document import Document

FOREIGN = {
    "part.stp": ("ISO-10303-21;\nHEADER;\n", "STEP"),
    "mesh.msh": ("CASCADE Topology V1, (c) Matra-Datavision\n", "OpenCASCADE"),
    "result.case": ("# made here\nFORMAT\ntype:  ensight gold\n", "EnSight"),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_format_is_called_by_its_name(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(FOREIGN[name][0])
    line = error_line("untangle", tmp_path / name, tmp_path / "out.vtk")
    assert line.endswith(f"{name}: is a file of {FOREIGN[name][1]}, which meshfix does not read")


def test_the_name_of_the_format_can_be_given(tmp_path: Path) -> None:
    points, cells = plate()
    meshio.write(tmp_path / "mesh.dat", meshio.Mesh(points, [("triangle", cells)]), file_format="nastran")
    assert read(tmp_path / "mesh.dat", form="nastran").mesh.topology.m == len(cells)
    run("quality", "-q", "--input-format", "nastran", tmp_path / "mesh.dat", code=3)
    assert "is not a readable medit file" in error_line("quality", "--input-format", "medit", tmp_path / "mesh.dat")
    run("quality", "--input-format", "nonsense", tmp_path / "mesh.dat", code=2)


def test_ucd_is_read_under_the_name_of_abaqus(tmp_path: Path) -> None:
    lines = ["# made here", "5 4 0 0 0", "1 0 0 0", "2 1 0 0", "3 1 1 0", "4 0 1 0", "5 0.5 0.5 0"]
    lines += ["7 1 tri 1 2 5", "8 1 tri 2 3 5", "9 1 tri 3 4 5", "10 1 tri 4 1 5", ""]
    (tmp_path / "mesh.inp").write_text("\n".join(lines))
    document = read(tmp_path / "mesh.inp")
    assert document.format.name == "avsucd"
    assert document.ids.tolist() == [7, 8, 9, 10]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.post", "$COOR\n1 0 0 0\n$COOR\n2 1 0 0\n$FIN\n", "several blocks of nodes"),
    ],
)  # fmt: skip
def test_what_would_be_misread_is_refused(name: str, text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ReadError, match=words):
        read(tmp_path / name)


def test_an_unmoved_mesh_comes_back_byte_for_byte_and_a_moved_one_tells_what_it_lost(tmp_path: Path) -> None:
    points, cells = block()
    valid = untangle(Mesh.build(points, cells)).after.points
    for name, coordinates in (("valid", valid), ("tangled", points)):
        path = tmp_path / f"{name}.post"
        meshio.Mesh(coordinates, [("tetra", cells)]).write(path, file_format="permas")
        path.write_text(path.read_text().replace("!\n$ELEMENT", "! STEEL\n$ELEMENT"))
    run("untangle", "-q", "--smooth", "0", tmp_path / "valid.post", tmp_path / "out.post")
    assert (tmp_path / "out.post").read_bytes() == (tmp_path / "valid.post").read_bytes()
    text = run("untangle", tmp_path / "tangled.post", tmp_path / "out.post").stdout.decode()
    (note,) = [line for line in text.splitlines() if "written anew" in line]
    assert "STEEL" in {*note.partition("dropped: ")[2].split(", ")}


def test_regions_of_other_formats_are_held(tmp_path: Path) -> None:
    points, cells = plate()
    right = points[cells].mean(axis=1)[:, 0] > 1
    interface = np.zeros(len(points), dtype=bool)
    held = read_with(tmp_path / "plain.vtk", points, cells, {}).mesh.movable
    for number, name in enumerate(("nastran:ref", "material", "Mat_ID", "RegionIds", "SUBDOMAIN", "part id")):
        path = tmp_path / f"{number}.{'bdf' if ':' in name else 'vtk'}"
        document = read_with(path, points, cells, {name.replace(" ", "_"): right.astype(np.int32) + 1})
        assert (held & ~document.mesh.movable).any()
        interface |= held & ~document.mesh.movable
        assert (interface == (held & ~document.mesh.movable)).all()
    density = {"material": np.random.default_rng(1).random(len(cells)), "materiality": right.astype(np.int32)}
    assert (read_with(tmp_path / "f.vtk", points, cells, density).mesh.movable == held).all()


def read_with(path: Path, points: np.ndarray, cells: np.ndarray, data: dict[str, np.ndarray]) -> Document:
    mesh = meshio.Mesh(points, [("triangle", cells)], cell_data={name: [values] for name, values in data.items()})
    mesh.write(path)
    return read(path)


def test_blocks_of_exodus_are_regions(tmp_path: Path) -> None:
    pytest.importorskip("netCDF4", reason="netCDF4 is not installed")
    points, cells = plate()
    right = points[cells].mean(axis=1)[:, 0] > 1
    meshio.Mesh(points, [("triangle", cells[~right]), ("triangle", cells[right])]).write(tmp_path / "two.e")
    document = read(tmp_path / "two.e")
    assert any(reason.startswith("between regions") for reason in document.fixed)


def test_numbering_that_is_arbitrary_by_convention_is_no_fault(tmp_path: Path) -> None:
    points, cells = plate()
    meshio.Mesh(points[:, :2], [("triangle", np.sort(cells, axis=1))]).write(tmp_path / "mesh.xml")
    document = read(tmp_path / "mesh.xml")
    assert not document.mesh.topology.misnumbered.any()
    outcome = untangle(document.mesh)
    assert outcome.valid
    write(document, outcome.after, tmp_path / "out.xml")
    assert read(tmp_path / "out.xml").mesh.check()[0] == 0


def test_words_of_libraries_do_not_reach_the_user(tmp_path: Path) -> None:
    (tmp_path / "a.bdf").write_text("BEGIN BULK\nGRID,1,,x,y,z\nENDDATA\n")
    assert "line 2: 'x' is not a number" in error_line("quality", tmp_path / "a.bdf")
    points, cells = plate()
    quads = [("triangle", cells), ("quad", np.array([[0, 1, 2, 3]]))]
    meshio.Mesh(points, quads).write(tmp_path / "in.vtk")
    line = error_line("untangle", tmp_path / "in.vtk", tmp_path / "o.f3grid")
    assert line.endswith("(meshio's writer fails on quadrilaterals and triangles whose points have three coordinates)")


def test_a_writer_that_left_a_file_open_is_tried_again(tmp_path: Path) -> None:
    """That of h5m fails on cell data."""
    points, cells = block()
    meshio.Mesh(points, [("tetra", cells)], cell_data={"a": [cells[:, 0]]}).write(tmp_path / "in.vtk")
    document = read(tmp_path / "in.vtk")
    assert write(document, document.mesh, tmp_path / "out.h5m")[1] == ("cell data a",)
    assert read(tmp_path / "out.h5m").mesh.check() == document.mesh.check()


@pytest.mark.parametrize("suffix", [".e", ".f3grid", ".cgns", ".med", ".h5m", ".hmf", ".vtu", ".xdmf"])
def test_a_mesh_that_is_written_anew_has_the_same_bytes(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = read(SAMPLES / "two_materials.msh")
    mesh = untangle(document.mesh).after
    for name in ("a", "b"):
        write(document, mesh, tmp_path / f"{name}{suffix}")
        monkeypatch.setattr(time, "ctime", lambda: "another day")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_what_cannot_be_written_is_told_before_the_work(tmp_path: Path) -> None:
    points, cells = plate()
    meshio.Mesh(points, [("triangle", cells)]).write(tmp_path / "in.vtk")
    for name, words in (
        ("o.ugrid", "name a .b8.ugrid"),
        ("o.node", "the format tetgen cannot be made of another; among those that can: abaqus, "),
    ):
        assert words in error_line("untangle", "--dry-run", tmp_path / "in.vtk", tmp_path / name)


def test_flac3d_is_not_abaqus(tmp_path: Path) -> None:
    points, cells = block()
    meshio.Mesh(points, [("tetra", cells)]).write(tmp_path / "in.f3grid")
    assert read(tmp_path / "in.f3grid").format.name == "flac3d"
