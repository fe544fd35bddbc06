"""The command line as a user meets it: streams, exit codes, reports, and one line for every error."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from click.testing import CliRunner
from commands import MESHFIX, TANGLED, VALID, error_line, run
from meshes import tangle
from places import SAMPLES

from meshfix_cli import __version__, read
from meshfix_cli.cli import main
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.metrics import METRICS
from meshfix_cli.quality.summary import summarise
from meshfix_cli.solve.strategies import STRATEGIES


def test_untangle_repairs_and_reports_on_stdout(tmp_path: Path) -> None:
    done = run("untangle", TANGLED, tmp_path / "out.vtk")
    text = done.stdout.decode()
    for words in (
        "inverted elements",
        "folded interior edges",
        "ceiling set by fixed",
        "Laplacian: ",
        "1st percentile",
    ):
        assert words in text
    assert text.splitlines()[-1] == "valid: no element is inverted"
    assert done.stderr == b""
    assert read(tmp_path / "out.vtk").mesh.check()[0] == 0


def test_json_has_a_schema_and_the_facts_of_the_table(tmp_path: Path) -> None:
    facts = json.loads(run("untangle", "--json", "--metric", "aspect_ratio", TANGLED, tmp_path / "o.vtk").stdout)
    assert facts["schema"] == 1
    assert facts["valid"] is True
    assert list(facts["quality"]) == ["before", "untangled", "smoothed"]
    assert facts["quality"]["before"]["inverted"] == facts["sweeps"][0]["inverted"] == 89
    assert facts["quality"]["before"]["metrics"]["aspect_ratio"]["worst"] is None  # JSON has no infinity
    assert facts["quality"]["smoothed"]["min_angle"] > 25
    perturbed = json.loads(run("perturb", "--json", "--percent", 10, "--dist", "0.1", VALID, tmp_path / "p.vtk").stdout)
    assert (perturbed["moved"], perturbed["distance"]) == (21, 0.1)


def test_quality_of_a_tangled_mesh_names_the_first_ten_and_exits_3() -> None:
    text = run("quality", TANGLED, code=3).stdout.decode()
    assert "NOT VALID: 89 elements are inverted; the first 10:" in text
    assert text.count("  element ") == 10
    facts = json.loads(run("quality", "--json", TANGLED, code=3).stdout)
    first = facts["first_inverted"][0]
    mesh = meshio.read(TANGLED)
    np.testing.assert_allclose(first["centroid"], mesh.points[mesh.cells[0].data[first["id"]]].mean(axis=0))


def test_inverted_elements_that_remain_exit_3(tmp_path: Path) -> None:
    out = tmp_path / "out.vtk"
    text = run("untangle", "--sweeps", 0, TANGLED, out, code=3).stdout.decode()
    assert "elements remain inverted" in text
    assert out.exists()
    run("untangle", "--sweeps", 0, "--allow-inverted", TANGLED, out)


def test_elements_numbered_against_their_neighbours_are_not_called_valid(tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    mesh.cells[0].data[3] = mesh.cells[0].data[3][::-1]
    mesh.write(tmp_path / "in.vtk")
    text = run("untangle", tmp_path / "in.vtk", tmp_path / "out.vtk", code=3).stdout.decode()
    assert "NOT VALID: 1 element is numbered against the rest of the mesh (element 3)" in text


def test_quiet_dry_run_and_history(tmp_path: Path) -> None:
    out, history = tmp_path / "out.vtk", tmp_path / "history.csv"
    assert run("untangle", "--quiet", TANGLED, out).stdout == b""
    out.unlink()
    assert "valid" in run("untangle", "--dry-run", "--history", history, TANGLED, out).stdout.decode()
    assert not out.exists()
    assert history.read_text().splitlines()[0] == "phase,sweep,inverted,min_measure,moved,seconds"
    assert "valid" in run("untangle", "--dry-run", TANGLED).stdout.decode()


@pytest.mark.parametrize("strategy", ["auto", "FF"])
def test_same_bytes_for_any_number_of_threads(
    tmp_path: Path, fine: Mesh, strategy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ours, and those that BLAS, in which the minimiser sums, would take."""
    meshio.Mesh(tangle(fine).points, [("tetra", fine.topology.simplices)]).write(tmp_path / "in.vtk")
    outputs = set()
    for threads in (1, 2, 3):
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", str(threads))
        arguments = ["--quiet", "--strategy", strategy, "--threads", threads]
        run("untangle", *arguments, tmp_path / "in.vtk", tmp_path / "out.vtk")
        outputs.add((tmp_path / "out.vtk").read_bytes())
    assert len(outputs) == 1


def test_output_format_by_name_and_by_extension(tmp_path: Path) -> None:
    run("untangle", "--quiet", TANGLED, tmp_path / "out.obj")
    assert (tmp_path / "out.obj").read_text().count("\nf ") == 332
    assert run("untangle", "--quiet", "--format", "gmsh22", TANGLED).stdout.startswith(b"$MeshFormat\n2.2")


def test_a_file_in_the_place_of_a_command() -> None:
    line = error_line(TANGLED, "out.vtk", code=2)
    assert line == f"Error: {TANGLED!r} is a file, and no command. Did you mean 'meshfix untangle'?"


def test_the_data_of_another_file_name_that(tmp_path: Path) -> None:
    (tmp_path / "mesh.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(64))
    (tmp_path / "mesh.xdmf").touch()
    assert error_line("quality", tmp_path / "mesh.h5").endswith("; mesh.xdmf, beside it, may tell: name that")


@pytest.mark.parametrize(
    ("content", "name", "words"),
    [
        (None, "missing.vtk", "No such file or directory"),
        (b"", "empty.vtk", "is empty"),
        (b"\x00\xff\x17binary noise" * 50, "noise.vtk", "not a readable vtk"),
        (b"\x00\xff\x17binary noise" * 50, "noise.xyz", "format is not recognised"),
        (b"\x89HDF\r\n\x1a\n" + bytes(64), "noise.xyz", "HDF5 whose format is not recognised"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n", "range.obj", "line 4: there is no vertex 99"),
        (b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "nan.obj", "not finite"),
        (b"v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n", "inf.obj", "not finite"),
        (b"v 0 0 0\nv 1 0 0\n", "none.obj", "no elements in it that are judged"),
    ],
)
@pytest.mark.parametrize("command", ["untangle", "perturb", "quality"])
def test_bad_input_is_one_line(command: str, content: bytes | None, name: str, words: str, tmp_path: Path) -> None:
    source, target = tmp_path / name, tmp_path / "out.vtk"
    if content is not None:
        source.write_bytes(content)
    extra = ["--percent", 5, "--dist", "h"] if command == "perturb" else []
    arguments = [source] if command == "quality" else [source, target]
    line = error_line(command, *extra, *arguments)
    assert words in line
    assert name in line
    assert not target.exists()


def test_truncated_files_are_refused(tmp_path: Path) -> None:
    for name in ("bracket.vtk", "two_materials.msh"):
        data = (SAMPLES / name).read_bytes()
        for share in (0.1, 0.3, 0.6, 0.9):
            path = tmp_path / name
            path.write_bytes(data[: int(share * len(data))])
            error_line("untangle", path, tmp_path / "out.vtk")
    assert not (tmp_path / "out.vtk").exists()


def test_curved_meshes_are_judged(tmp_path: Path) -> None:
    points = np.random.default_rng(1).random((10, 3))
    meshio.Mesh(points, [("tetra10", [list(range(10))])]).write(tmp_path / "tet10.vtk")
    text = run("untangle", tmp_path / "tet10.vtk", tmp_path / "out.vtk", code=3).stdout.decode()
    assert "1 tetrahedron of 10 nodes" in text
    assert "NOT VALID: 1 element remains inverted" in text


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".off"])
def test_a_format_that_cannot_hold_the_mesh_is_refused(suffix: str, tmp_path: Path) -> None:
    """meshio writes tetrahedra to these as an empty mesh, without a word."""
    line = error_line("untangle", SAMPLES / "bracket_tangled.vtk", tmp_path / f"out{suffix}")
    assert "cannot be written as" in line
    assert list(tmp_path.iterdir()) == []


def test_a_conversion_says_that_it_is_one(tmp_path: Path) -> None:
    text = run("untangle", SAMPLES / "two_materials.msh", tmp_path / "out.vtu").stdout.decode()
    assert "note: converted from gmsh22 to vtu; dropped: comments" in text
    assert "note:" not in run("untangle", SAMPLES / "two_materials.msh", tmp_path / "out.msh").stdout.decode()


def test_cells_say_where(tmp_path: Path) -> None:
    """meshio reads what ParaView will show, and numpy says what it must be."""
    out, cells = tmp_path / "out.vtk", tmp_path / "cells.vtu"
    run("quality", "-q", "--cells", cells, TANGLED, code=3)
    shown, document = meshio.read(cells), read(TANGLED)
    corners = shown.points[shown.cells[0].data][:, :, :2]
    areas = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 2
    np.testing.assert_allclose(shown.cell_data["measure"][0], areas, atol=1e-15)
    assert shown.cell_data["inverted"][0].sum() == (areas <= 0).sum() == document.mesh.check()[0]
    assert shown.cell_data["min_angle"][0].min() == pytest.approx(summarise(document.mesh).min_angle)
    np.testing.assert_array_equal(shown.cell_data["element"][0], document.ids)
    assert "distance_moved" not in shown.point_data
    run("untangle", "-q", "--cells", cells, TANGLED, out)
    shown = meshio.read(cells)
    expected = np.linalg.norm(read(out).source.points - document.source.points, axis=1)
    np.testing.assert_allclose(shown.point_data["distance_moved"], expected, atol=1e-15)
    np.testing.assert_array_equal(shown.points, read(out).source.points)
    assert not shown.cell_data["inverted"][0].any()


def test_cells_need_a_format_that_holds_them(tmp_path: Path) -> None:
    for command in (["quality"], ["untangle", tmp_path / "o.vtk"]):
        line = error_line(command[0], "--cells", tmp_path / "cells.obj", TANGLED, *command[1:], code=2)
        assert "the name of a file of cells ends in .vtu or .vtk" in line
    line = error_line("quality", "--cells", tmp_path / "cells", SAMPLES / "two_materials.msh")
    assert "quality can be drawn from .vtu and .vtk files, and this would be gmsh22" in line
    assert "name a file" in error_line("quality", "--cells", "-", TANGLED, code=2)
    assert "is the name of a mesh" in error_line("quality", "--cells", TANGLED, TANGLED, code=2)
    assert "take one INPUT" in error_line("quality", "--cells", tmp_path / "c.vtu", TANGLED, VALID, code=2)
    assert list(tmp_path.iterdir()) == []


def test_all_lists_every_inverted_element() -> None:
    inverted = read(TANGLED).mesh.check()[0]
    assert run("quality", TANGLED, code=3).stdout.decode().count("  element ") == 10
    assert run("quality", "--all", TANGLED, code=3).stdout.decode().count("  element ") == inverted
    facts = json.loads(run("quality", "--all", "--json", TANGLED, code=3).stdout)
    assert len(facts["first_inverted"]) == inverted


def test_requirements() -> None:
    smallest = summarise(read(VALID).mesh).min_angle
    text = run(
        "quality", "--require", f"min_angle>={smallest - 1}", "--require", "inverted == 0", VALID
    ).stdout.decode()
    assert text.count("\nmet: ") == 2
    failing = ["quality", "--require", f"min_angle > {smallest + 1}", "--require", "aspect_ratio<1e6", VALID]
    text = run(*failing, code=3).stdout.decode()
    assert f"NOT MET: min_angle > {smallest + 1:g} (it is {smallest:g})" in text
    assert "met: aspect_ratio < 1e+06" in text
    facts = json.loads(run(*failing, "--json", code=3).stdout)
    assert [one["met"] for one in facts["requirements"]] == [False, True]
    assert facts["valid"] is True


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("min_angle", "is not a condition such as"),
        ("min_angle => 5", "is not a condition such as"),
        ("beauty > 5", "'beauty' is none of elements, inverted, folded, min_measure"),
        ("min_angle > x", "'x' is not a number"),
        ("min_angle > nan", "'nan' is not a number"),
    ],
)
def test_requirements_that_make_no_sense(condition: str, words: str) -> None:
    assert words in error_line("quality", "--require", condition, VALID, code=2)


def test_orientation_is_mended_where_asked(tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    mesh.cells[0].data[3] = mesh.cells[0].data[3][::-1]
    mesh.write(tmp_path / "in.vtk", file_format="vtk42", binary=False)
    text = run("quality", tmp_path / "in.vtk", code=3).stdout.decode()
    assert "NOT VALID: 1 element is numbered against the rest of the mesh (element 3)" in text
    assert "--fix-orientation renumbers it" in text
    text = run("untangle", "--fix-orientation", tmp_path / "in.vtk", tmp_path / "out.vtk").stdout.decode()
    assert "note: renumbered 1 triangle" in text
    before, after = (set((tmp_path / name).read_bytes().split(b"\n")) for name in ("in.vtk", "out.vtk"))
    assert len(before - after) == len(after - before) == 1
    run("quality", tmp_path / "out.vtk")


def test_a_part_numbered_the_other_way_is_mirrored_not_tangled(tmp_path: Path) -> None:
    one = meshio.read(VALID)
    triangles = one.cells[0].data
    points = np.concatenate([one.points + shift for shift in np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]])])
    cells = np.concatenate([triangles, (triangles + len(one.points))[:, ::-1], triangles + 2 * len(one.points)])
    meshio.Mesh(points, [("triangle", cells)]).write(tmp_path / "in.vtk")
    text = run("untangle", tmp_path / "in.vtk", tmp_path / "out.vtk").stdout.decode()
    assert f"note: {len(triangles)} triangles in separate parts are numbered the other way round (mirrored)" in text
    facts = json.loads(run("quality", "--json", tmp_path / "in.vtk").stdout)
    assert (facts["valid"], facts["mirrored"], facts["misnumbered"]) == (True, len(triangles), 0)
    np.testing.assert_array_equal(meshio.read(tmp_path / "out.vtk").cells[0].data, cells)
    run("untangle", "-q", "--fix-orientation", tmp_path / "in.vtk", tmp_path / "out.vtk")
    assert "mirrored" not in run("quality", tmp_path / "out.vtk").stdout.decode()


def test_double_keeps_what_single_precision_would_invert(tmp_path: Path) -> None:
    """A star at 2^23, where float32 holds nothing but integers, and none of them sees the whole rim."""
    rim = np.array([[-3, -1], [1, -3], [0, 1], [2, 3], [3, 3]]) + 2.0**23 + 8
    points = np.column_stack([rim, np.zeros(5)]).astype("f4")
    fan = [[i, (i + 1) % 4, 4] for i in range(4)]
    path, out = tmp_path / "coarse.vtk", tmp_path / "out.vtk"
    meshio.Mesh(points, [("triangle", fan)]).write(path, binary=True)
    single = run("untangle", path, out, code=3).stdout.decode()
    assert "positions rounded to the file's float32 invert" in single
    assert "--double stores them as they are" in single
    assert read(out).mesh.check()[0] > 0
    run("untangle", "--double", path, out)
    document = read(out)
    assert document.source.points.dtype == np.float64
    assert document.mesh.check()[0] == 0


def test_double_needs_a_format_that_has_it(tmp_path: Path) -> None:
    triangle = meshio.Mesh(np.eye(3), [("triangle", [[0, 1, 2]])])
    triangle.write(tmp_path / "in.stl", binary=True)
    line = error_line("untangle", "--double", tmp_path / "in.stl", tmp_path / "out.stl")
    assert "coordinates of stl files cannot be double" in line


def test_what_meshio_would_write_anew_is_not_replaced_without_a_backup(tmp_path: Path) -> None:
    path = tmp_path / "in.post"
    meshio.read(TANGLED).write(path)
    original = path.read_bytes()
    assert "name another OUTPUT, or use --backup" in error_line("untangle", path, path)
    assert path.read_bytes() == original
    assert "note: written anew as permas" in run("untangle", "--backup", path, path).stdout.decode()
    assert (tmp_path / "in.post.bak").read_bytes() == original


def test_requirements_where_the_repair_happens(tmp_path: Path) -> None:
    text = run("untangle", "--require", "min_angle > 89", TANGLED, tmp_path / "o.vtk", code=3).stdout.decode()
    assert "NOT MET: min_angle > 89" in text
    assert read(tmp_path / "o.vtk").mesh.check()[0] == 0
    run("untangle", "-q", "--require", "min_angle > 10", TANGLED, tmp_path / "o.vtk")


def test_coordinates_near_the_end_of_single_precision(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [3e38, 0, 0], [3e38, 3e38, 0], [0, 3e38, 0]], "f4")
    meshio.Mesh(points, [("triangle", [[0, 1, 2], [0, 3, 2]])]).write(tmp_path / "huge.vtk")
    assert run("quality", "--json", tmp_path / "huge.vtk", code=3).stderr == b""


def test_what_is_said_of_a_valid_mesh_is_true(tmp_path: Path) -> None:
    """Only where angles were looked at are they spoken of."""
    sample = SAMPLES / "bracket.vtk"  # valid, with angles below the threshold
    for options in (["--smooth", 0], ["--only-invalid"], ["--only-invalid", "--smooth", "best"]):
        text = run("untangle", *options, "--threshold", 30, sample, tmp_path / "o.vtk").stdout.decode()
        assert "note: no element is inverted: nothing was moved" in text
        assert (tmp_path / "o.vtk").read_bytes() == sample.read_bytes()


def test_the_best_smoothing_is_named_in_the_report(tmp_path: Path) -> None:
    facts = [
        json.loads(run("untangle", "--json", "--smooth", smooth, TANGLED, tmp_path / "o.vtk").stdout)
        for smooth in (3, "best")
    ]
    assert {"smoothing", "smoothing all at once"} <= {sweep["phase"] for sweep in facts[1]["sweeps"]}
    angles = [one["quality"]["smoothed"]["mean_min_angle"] for one in facts]
    assert angles[1] > angles[0]
    assert b"best" in run("untangle", "--help").stdout


def test_options_of_holding_and_smoothing_reach_the_work(tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    inner = np.flatnonzero(read(VALID).mesh.movable)
    mesh.point_data["hold"] = np.isin(np.arange(len(mesh.points)), inner[:7]).astype(float)
    mesh.cell_data["part"] = [(mesh.points[mesh.cells[0].data].mean(axis=1)[:, 0] > 1.5).astype(float)]
    mesh.write(tmp_path / "in.vtk")
    options = ["--json", "--dry-run", "--fix", "hold", "--regions", "part", "--smooth", 1, "--threshold", 60]
    facts = json.loads(run("untangle", *options, tmp_path / "in.vtk").stdout)
    assert facts["fixed"]["by --fix hold"] + facts["fixed"]["between regions of part"] > 10
    assert [sweep["phase"] for sweep in facts["sweeps"]] == ["input", "smoothing"]
    moved = [run("perturb", "--percent", 20, "--dist", "h", "--seed", s, "-q", VALID).stdout for s in (0, 0, 1)]
    assert moved[0] == moved[1] != moved[2]


def test_coordinates_that_the_file_cannot_hold(tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    meshio.Mesh(mesh.points.astype("f4"), mesh.cells).write(tmp_path / "in.vtk")
    arguments = ["perturb", "--percent", 20, "--dist", "1e39", tmp_path / "in.vtk", tmp_path / "out.vtk"]
    assert "too large for the numbers of the file" in error_line(*arguments)
    assert not (tmp_path / "out.vtk").exists()


def test_one_unreadable_mesh_does_not_stop_the_others(tmp_path: Path) -> None:
    done = run("quality", VALID, tmp_path / "missing.vtk", TANGLED, code=4)
    assert "plate.vtk" in done.stdout.decode()
    assert "plate_tangled.vtk" in done.stdout.decode()
    assert done.stderr.decode().count("\n") == 1


def test_vertices_stay_near(tmp_path: Path) -> None:
    arguments = ["untangle", "--max-move", "0.35", "--only-invalid", "--json", TANGLED, tmp_path / "out.vtk"]
    done = subprocess.run([MESHFIX, *map(str, arguments)], capture_output=True, check=True)
    far = json.loads(done.stdout)["displacement"]
    moved = np.linalg.norm(read(tmp_path / "out.vtk").mesh.points - read(TANGLED).mesh.points, axis=1)
    assert far["largest"] == pytest.approx(moved.max())
    assert moved.max() <= 0.35
    assert far["vertices"] == (moved > 0).sum()
    assert far["mean"] == pytest.approx(moved[moved > 0].mean())
    for wrong in ("x", "-1", "nan"):
        error_line("untangle", "--max-move", wrong, TANGLED, tmp_path / "no.vtk", code=2)


@pytest.mark.parametrize(
    "arguments",
    [
        ["untangle", "--strategy", "XX", TANGLED, "o.vtk"],
        ["untangle", "--sweeps", "-1", TANGLED, "o.vtk"],
        ["untangle", "--smooth", "x", TANGLED, "o.vtk"],
        ["untangle", "--smooth", "9" * 20, TANGLED, "o.vtk"],
        ["untangle", "--threshold", "91", TANGLED, "o.vtk"],
        ["untangle", "--threads", "0", TANGLED, "o.vtk"],
        ["untangle", "--threads", "3000000000", TANGLED, "o.vtk"],
        ["untangle", "--metric", "beauty", TANGLED, "o.vtk"],
        ["untangle", "--format", "xyz", TANGLED, "o.vtk"],
        ["untangle", "--threshold", "nan", TANGLED, "o.vtk"],
        ["perturb", "--percent", "nan", "--dist", "h", VALID, "o.vtk"],
        ["perturb", "--percent", "101", "--dist", "h", VALID, "o.vtk"],
        ["perturb", "--percent", "5", "--dist", "-1", VALID, "o.vtk"],
        ["perturb", "--percent", "5", VALID, "o.vtk"],
        ["quality"],
        ["mend", VALID],
    ],
)
def test_wrong_usage_exits_2(arguments: list[str], tmp_path: Path) -> None:
    done = subprocess.run(
        [MESHFIX, *arguments], capture_output=True, check=False, cwd=tmp_path, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 2
    assert done.stderr.decode().splitlines()[-1].startswith("Error: ")
    assert list(tmp_path.iterdir()) == []


def test_help_of_every_command_names_every_option_and_strategy() -> None:
    assert len(main.commands) == 4
    assert "process" not in main.commands
    for name, command in main.commands.items():
        text = CliRunner().invoke(main, [name, "--help"]).output
        assert command.help
        for parameter in command.params:
            if parameter.param_type_name == "option":
                assert parameter.opts[0] in text
                assert parameter.help or name == "untangle" or parameter.name == "seed"
    text = CliRunner().invoke(main, ["untangle", "--help"]).output
    assert all(strategy in text for strategy in STRATEGIES)
    assert all(metric in text for metric in METRICS)


def test_python_dash_m() -> None:
    done = subprocess.run([sys.executable, "-m", "meshfix_cli", "--version"], capture_output=True, check=True, cwd="/")
    assert done.stdout == run("--version").stdout


def test_the_version_tells_the_kernels_and_the_threads() -> None:
    text = run("--version").stdout.decode()
    assert re.fullmatch(rf"meshfix {__version__} \(kernels for (AVX2|any processor), \d+ threads?; Python .*\)\n", text)


def test_verbose_shows_each_sweep_and_the_report_each_phase(tmp_path: Path) -> None:
    done = run("untangle", "--verbose", "--history", tmp_path / "h.csv", TANGLED, tmp_path / "o.vtk")
    rows = (tmp_path / "h.csv").read_text().splitlines()[1:]
    lines = done.stderr.decode().splitlines()
    assert len(lines) == len(rows)
    assert lines[0].startswith("input: 89 inverted, smallest area -0.168")
    for line, row in zip(lines[1:], rows[1:], strict=True):
        phase, sweep, inverted, _, moved, _ = row.split(",")
        assert line.startswith(f"{phase} {sweep}: {inverted} inverted")
        assert f"{moved} vertices moved" in line
    phases = [line for line in done.stdout.decode().splitlines() if re.match("(Laplacian|smoothing): ", line)]
    assert [re.sub(r", [\d.e-]+ s$", "", line) for line in phases] == [
        "Laplacian: 1 sweep, 0 inverted, smallest area 0.00154",
        "smoothing: 3 sweeps, 0 inverted, smallest area 0.00822",
    ]
    run("untangle", "--verbose", "--quiet", TANGLED, tmp_path / "o.vtk", code=2)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_options_and_files(shell: str) -> None:
    """As click has it: the shell runs the command with a variable."""
    source = subprocess.run(
        [MESHFIX], env={**os.environ, "_MESHFIX_COMPLETE": f"{shell}_source"}, capture_output=True, check=True
    )
    assert b"_MESHFIX_COMPLETE" in source.stdout
    for words, expected in (("meshfix untangle --stra", b"--strategy"), ("meshfix untangle --strategy L", b"LUS")):
        variables = {"COMP_WORDS": words, "COMP_CWORD": str(words.count(" ")), "_MESHFIX_COMPLETE": f"{shell}_complete"}
        variables["COMP_CWORD"] = words.split()[-1] if shell == "fish" else variables["COMP_CWORD"]
        done = subprocess.run([MESHFIX], env={**os.environ, **variables}, capture_output=True, check=True)
        assert expected in done.stdout
