"""The commands on files of elements of every type."""

from __future__ import annotations

import json
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import error_line, run
from elements import MESHES
from reports import built, tangled
from sampling import jacobians, measure

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import evaluate_at


def written(path: Path, name: str, mesh: Mesh) -> list[tuple[str, list[int]]]:
    """Write a mesh in runs of cells whose types alternate; return the cells as the file numbers them."""
    space = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dimension)))
    runs = [(key, rows[half::2]) for half in (0, 1) for key, rows in MESHES[name]()[1]]
    meshio.write_points_cells(path, space, runs)
    return [(key, row.tolist()) for key, rows in runs for row in rows]


@pytest.mark.parametrize(("name", "suffix"), [("every solid", ".vtu"), ("quads and triangles", ".vtk")])
def test_cells_say_where(name: str, suffix: str, tmp_path: Path) -> None:
    """meshio reads them; sampling says what is inverted, and Gauss's rule how large it is."""
    mesh, cells = tangled(name), tmp_path / f"cells{suffix}"
    given = written(tmp_path / "in.vtu", name, mesh)
    told = json.loads(run("quality", "--json", "--cells", cells, tmp_path / "in.vtu", code=3).stdout)
    shown = meshio.read(cells)
    seen = inverted = 0
    for i, block in enumerate(shown.cells):
        data = {key: values[i] for key, values in shown.cell_data.items()}
        assert [(block.type, row.tolist()) for row in block.data] == [given[number] for number in data["element"]]
        smallest = jacobians(mesh.points, block.type, block.data, 6).min(axis=1)
        wrong = data["inverted"].astype(bool)
        assert wrong[smallest < 0].all()
        assert (wrong & (smallest > 0)).sum() <= 2, "between the places"
        expected = evaluate_at("scaled_jacobian", ELEMENTS[block.type], mesh.points[block.data])
        np.testing.assert_allclose(data["scaled_jacobian"], expected, atol=1e-12)
        assert data["measure"].sum() == pytest.approx(measure(mesh.points, block.type, block.data), abs=1e-12)
        seen, inverted = seen + len(block.data), inverted + int(wrong.sum())
    assert (seen, inverted) == (mesh.topology.m, told["inverted"])
    assert set(shown.cell_data) == {"measure", "scaled_jacobian", "inverted", "element"}


def test_a_run_from_file_to_file(tmp_path: Path) -> None:
    path, out = tmp_path / "in.vtu", tmp_path / "out.vtu"
    given = written(path, "hexes beside tets", tangled("hexes beside tets"))
    found = run("quality", "--all", path, code=3).stdout.decode()
    named = [line.split()[:2] for line in found.splitlines() if line.startswith("  ")]
    words = {"tetrahedron": "tetra"}
    assert len(named) > 20
    assert all(given[int(number)][0] == words.get(word, word) for word, number in named)
    page = tmp_path / "page.html"
    text = run("untangle", "--verbose", "--report", page, "--require", "scaled_jacobian > 0", path, out).stdout.decode()
    assert "┃ hexahedra ┃" in text
    assert "met: scaled_jacobian > 0 (it is 0." in text
    assert text.count("valid: no element is inverted") == 1
    assert "tetrahedron" in page.read_text(encoding="utf-8")
    again = run("untangle", "--smooth", 0, out, tmp_path / "again.vtu").stdout.decode()
    assert "note: no element is inverted: nothing was moved" in again


def test_what_no_element_has_is_refused_before_the_work(tmp_path: Path) -> None:
    path, out = tmp_path / "in.vtu", tmp_path / "out.vtu"
    written(path, "hex box", built("hex box"))
    for command in (["quality"], ["untangle", out]):
        line = error_line(command[0], "--require", "min_angle >= 5", path, *command[1:])
        assert "no element has the min_angle required; only triangles, quadrilaterals and tetrahedra have one" in line
    assert not out.exists()
    told = json.loads(run("quality", "--json", path).stdout)
    assert told["min_angle"] is None
