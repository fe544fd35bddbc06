"""Reports on a terminal: of any width, and in words that fit the numbers."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import TANGLED, lines_of, on_terminal, run
from files_pvtu import split
from places import SAMPLES

from meshfix_cli.report.facts import what_is_fixed

# One of something that is called as several are.
WRONG = re.compile(r"(?<![\d.,])1 (?!(is|was|has) )(\w+s|vertices|tetrahedra|polyhedra|\w+ are)\b")


def test_a_mesh_without_a_free_vertex_is_not_moved_by_a_length(tmp_path: Path) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    meshio.Mesh(points, [("triangle", np.array([[0, 1, 2]]))]).write(tmp_path / "in.vtk")
    shown = run("perturb", "--percent", 25, "--dist", "2h", tmp_path / "in.vtk", tmp_path / "o.vtk").stdout.decode()
    assert "\nmoved no vertex\n" in shown


def test_what_crosses_itself_is_called_what_it_is() -> None:
    assert what_is_fixed({"on the boundary": 7}) == "the fixed boundary"
    assert what_is_fixed({"on the boundary": 7, "held by --fix pin": 2}) == "what held vertices span"


@pytest.mark.parametrize("columns", [20, 40, 60, 80, 100])
@pytest.mark.parametrize("sample", ["plate_tangled.vtk", "bracket_tangled.vtk"])
def test_a_narrow_terminal_breaks_no_number(columns: int, sample: str, tmp_path: Path) -> None:
    arguments = "untangle", "--metric", "aspect_ratio", SAMPLES / sample, tmp_path / "o.vtk"
    code, shown = on_terminal(*arguments, COLUMNS=str(columns))
    assert code == 0
    facts = json.loads(run("untangle", "--json", *arguments[1:]).stdout)
    lines = lines_of(shown)
    begin = next(i for i, line in enumerate(lines) if "fixed" in line) + 1
    table = lines[begin : next(i for i, line in enumerate(lines) if line.startswith("Laplacian:"))]
    words = " ".join(table).split()
    for stage in facts["quality"].values():
        numbers = (
            f"{stage['inverted']:,}", f"{stage['min_measure']:.3g}", f"{stage['min_angle']:.3f}",
            f"{stage['max_angle']:.3f}", f"{stage['mean_min_angle']:.2f}", f"{stage['percentile_1']:.2f}",
        )  # fmt: skip
        assert set(numbers) <= set(words)
    assert not {"…", "..."} & set("".join(table))
    assert {"inverted", "elements", "percentile", "ceiling", "aspect_ratio,"} <= set(words)
    longest = max(len(f"  untangled: {'x' * 15}"), columns)  # a histogram is as wide as it has bins
    assert max(map(len, table)) <= longest


@pytest.mark.parametrize("columns", [20, 40, 100])
def test_the_summary_of_a_batch_on_a_narrow_terminal(columns: int, tmp_path: Path) -> None:
    shutil.copy(TANGLED, tmp_path / "a.vtk")
    arguments = "batch", "--jobs", 1, tmp_path / "a.vtk", "--output-dir", tmp_path / "out"
    code, shown = on_terminal(*arguments, COLUMNS=str(columns))
    assert code == 0
    assert "0 of 1 file" in shown
    assert "0 of 1 files" not in shown
    assert {"332", "30.703", "0.022", "NOT"} <= set(" ".join(lines_of(shown)).split())


def fan(folder: Path, *, inverted: bool) -> Path:
    """Four triangles around one vertex that is free."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1.5 if inverted else 0.4, 0.5, 0]])
    cells = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    meshio.write_points_cells(folder / "fan.vtk", points, [("triangle", cells)])
    return folder / "fan.vtk"


def test_words_fit_the_numbers(tmp_path: Path) -> None:
    """One vertex that moves, one sweep, one element that is inverted, one piece, and a file of one element."""
    path = fan(tmp_path, inverted=True)
    text = run("untangle", "--verbose", path, tmp_path / "o.vtk")
    told = (text.stdout + text.stderr).decode()
    assert "1 vertex moved" in told
    assert "moved 1 vertex by" in told
    assert "Laplacian: 1 sweep, 0 inverted" in told
    found = run("quality", path, code=3).stdout.decode()
    assert "NOT VALID: 1 element is inverted:" in found
    triangle = tmp_path / "one.obj"
    triangle.write_text("v 0 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\n")
    single = run("quality", triangle).stdout.decode()
    assert "1 triangle, 3 vertices: 0 free" in single
    assert "note: the element is numbered the other way round" in single
    points, cells = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    alone = run("quality", split(tmp_path / "in.pvtu", points, cells, np.zeros(1, dtype=np.int64))).stdout.decode()
    assert "note: joined 1 file at 0 common points, by equal coordinates" in alone
    short = tmp_path / "short.obj"
    short.write_text("v 0 0 0\nf 1 2 3\n")
    for words in (told, found, single, alone, run("quality", short, code=1).stderr.decode()):
        assert not WRONG.search(words), words
