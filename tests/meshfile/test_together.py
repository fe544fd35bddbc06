"""Meshes whose parts lie in several files: where these go, and what is never replaced."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import error_line, run
from files_abaqus import elements, nodes
from files_tetgen import FILES
from shapes import block
from test_openfoam import tangled

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError, WriteError
from meshfix_cli.workers.batch import outputs


def of_one_name(folder: Path) -> Path:
    """A file that includes two of one name, from two folders."""
    points, cells = block()
    half = len(points) // 2
    for name, rows in (("a", slice(0, half)), ("b", slice(half, None))):
        (folder / name).mkdir()
        text = "*NODE, NSET=All\n" + nodes(points[rows], np.arange(1, len(points) + 1)[rows])
        (folder / name / "n.inp").write_text(text)
    body = elements(cells, np.arange(1, len(points) + 1))
    includes = "*INCLUDE, INPUT=a/n.inp\n*INCLUDE, INPUT=b/n.inp\n"
    (folder / "m.inp").write_text(f"{includes}*ELEMENT, TYPE=C3D4, ELSET=E\n{body}")
    return folder / "m.inp"


@pytest.mark.parametrize("name", ["o.inp", "my o.inp", "o,1.inp"])
def test_files_of_one_name_stay_two(name: str, tmp_path: Path) -> None:
    document = read(of_one_name(tmp_path))
    (tmp_path / "out").mkdir()
    after = untangle(document.mesh).after
    write(document, after, tmp_path / "out" / name)
    stem = Path(name).stem
    assert {one.name for one in (tmp_path / "out").iterdir()} == {name, f"{stem}_a_n.inp", f"{stem}_b_n.inp"}
    back = read(tmp_path / "out" / name)
    np.testing.assert_array_equal(back.source.points, document.file_points(after))


def test_steps_that_include_files_are_told(tmp_path: Path) -> None:
    path = of_one_name(tmp_path)
    assert not read(path).notes
    path.write_text(path.read_text() + "*STEP\n*INCLUDE, INPUT=loads.inp\n*END STEP\n")
    assert read(path).notes == ("its steps include other files, which are left where they are",)


def test_a_folder_is_not_mixed_with_another_mesh(tmp_path: Path) -> None:
    case = tangled(tmp_path / "case", "text")
    run("untangle", "-q", case, tmp_path / "out")
    run("untangle", "-q", case, tmp_path / "out")  # its like is replaced
    (tmp_path / "out" / "constant" / "polyMesh" / "cellLevel").write_text("of another mesh")
    assert "has a file cellLevel of another mesh" in error_line("untangle", case, tmp_path / "out")
    assert "a folder goes into a folder" in error_line("untangle", case, tmp_path / "x.foam")
    run("untangle", "-q", case / "case.foam", tmp_path / "new")
    assert read(tmp_path / "new" / "case.foam").mesh.check()[0] == 0


def test_what_would_become_part_of_the_output_is_not_left_there(tmp_path: Path) -> None:
    FILES["zero.node"](tmp_path / "in.node")
    (tmp_path / "in.face").unlink()
    (tmp_path / "out.face").write_text("0 1\n")
    assert "out.face is there, and would belong to it" in error_line(
        "untangle", tmp_path / "in.node", tmp_path / "out.node"
    )
    assert "is neither a .node nor an .ele" in error_line("untangle", tmp_path / "in.node", tmp_path / "ver.1")


def test_a_batch_knows_what_belongs_together(tmp_path: Path) -> None:
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
        FILES["zero.node"](tmp_path / folder / "m.node")
    with pytest.raises(ValueError, match="would both be written to"):
        outputs([str(tmp_path / "x" / "m.node"), str(tmp_path / "y" / "m.ele")], str(tmp_path / "out"))
    with pytest.raises(ValueError, match="would both be written to"):
        outputs([str(tmp_path / "x" / "A.foam"), str(tmp_path / "y" / "B.foam")], str(tmp_path / "out"))
    assert len(outputs([str(tmp_path / "x" / "m.node")], str(tmp_path / "out"))) == 1


def test_numbers_without_orientation_get_one_in_a_format_that_has_it(tmp_path: Path) -> None:
    points, cells = block()
    (tmp_path / "in.xml").write_text(
        f'<dolfin><mesh celltype="tetrahedron" dim="3"><vertices size="{len(points)}">\n'
        + "".join(f'<vertex index="{i}" x="{x}" y="{y}" z="{z}" />\n' for i, (x, y, z) in enumerate(points.tolist()))
        + f'</vertices><cells size="{len(cells)}">\n'
        + "".join(
            f'<tetrahedron index="{i}" v0="{a}" v1="{b}" v2="{c}" v3="{d}" />\n'
            for i, (a, b, c, d) in enumerate(np.sort(cells, axis=1).tolist())
        )
        + "</cells></mesh></dolfin>\n"
    )
    run("untangle", "-q", tmp_path / "in.xml", tmp_path / "out.vtu")
    run("quality", "-q", tmp_path / "out.vtu")
    run("untangle", "-q", tmp_path / "in.xml", tmp_path / "out.xml")
    assert (tmp_path / "out.xml").read_bytes().count(b"<tetrahedron") == len(cells)


def test_what_includes_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.inp").write_text("*INCLUDE, INPUT=m.inp\n")
    with pytest.raises((ReadError, WriteError)):
        read(tmp_path / "m.inp")
