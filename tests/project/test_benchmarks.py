"""The benchmarks run, and the samples are what their script makes."""

from __future__ import annotations

import csv
import shutil
import sys
from pathlib import Path

import batch
import compare
import generate
import kernels
import process
import process_elements
import pytest
import repairer
import stress
import tables
from phases import PHASES
from places import SAMPLES

from meshfix_cli.solve.strategies import Move


def test_tables_of_a_tetrahedral_and_of_a_triangular_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, words in (
        ("bracket.vtk", ("Table 4.2", "Table 4.3")),
        ("plate.vtk", ("Table 4.1", "LS untangles 7 of 7")),
    ):
        monkeypatch.setattr(sys, "argv", ["tables.py", str(SAMPLES / name), "--output", str(tmp_path)])
        tables.main()
        printed = capsys.readouterr().out
        assert all(word in printed for word in words)
    rows = list(csv.DictReader((tmp_path / "figure_4_4_LUS.csv").read_text().splitlines()))
    assert int(rows[0]["inverted"]) > 0
    assert int(rows[-1]["inverted"]) == 0


@pytest.mark.parametrize("sample", ["bracket.vtk", "mixed_tangled.msh"])
def test_kernels_are_timed(sample: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["kernels.py", str(SAMPLES / sample), "--repeats", "1"])
    kernels.main()
    printed = capsys.readouterr().out
    timed = {move for move in Move if move.name.lower() in printed}
    assert timed == set(Move) - ({Move.UNTANGLE_COEFFICIENTS} if sample == "bracket.vtk" else set())
    assert "GB/s" in printed


def test_the_process_is_timed_in_phases(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["process.py", "--tets", "3000", "--repeats", "1"])
    process.main()
    printed = capsys.readouterr().out
    assert all(phase in printed for phase in PHASES)
    assert printed.count(" / ") == 6


def test_the_process_on_other_elements_is_timed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        sys, "argv", ["process_elements.py", "--counts", "100", "200", "--files", "binary VTK", "--repeats", "1"]
    )
    process_elements.main()
    printed = capsys.readouterr().out
    assert all(printed.count(f"{box}, binary VTK: an element") == 1 for box in process_elements.BOXES)


def test_many_meshes_are_timed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["batch.py", "--files", "10"])
    batch.main()
    rows = [line.split("│") for line in capsys.readouterr().out.splitlines() if line.startswith("│")]
    assert [row[1].strip() for row in rows] == ["one command for each", "batch --jobs 1", "batch --jobs 2"]
    assert all(float(row[-2]) > 0 for row in rows)  # how much faster: see benchmarks/RESULTS.md


def test_a_loop_is_timed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["repairer.py", "--sizes", "0.3", "--steps", "1"])
    repairer.main()
    rows = [line.split("│") for line in capsys.readouterr().out.splitlines() if line.startswith("│")]
    assert [row[1].strip() for row in rows] == list(repairer.CASES)
    assert all(float(row[-2]) > 0 for row in rows)  # how much faster: see benchmarks/RESULTS.md


def test_samples_are_what_the_script_makes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(generate, "__file__", str(tmp_path / "generate.py"))
    generate.main()
    made = sorted(p.name for p in tmp_path.iterdir())
    assert made == sorted(p.name for p in SAMPLES.iterdir() if p.suffix in (".vtk", ".msh", ".obj", ".inp"))
    assert all(b"by generate.py" in (SAMPLES / name).read_bytes() for name in made)
    total = sum((SAMPLES / name).stat().st_size for name in made)
    assert total < 3e6


def test_every_hard_case_that_has_a_solution_is_solved() -> None:
    results = [stress.run(case, "auto") for case in stress.cases()]
    assert len(results) >= 200
    assert len({result.case.family for result in results}) >= 8
    wrong = [result.case.name for result in results if result.verdict in (stress.FAILED, stress.WRONG)]
    assert not wrong
    assert [r.case.possible for r in results] == [r.verdict == stress.SOLVED for r in results]


def test_the_stress_suite_judges_by_itself(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A strategy that cannot solve all of them fails, and the exit code says so."""
    some = [case for case in stress.cases() if case.family == "annulus"]
    monkeypatch.setattr(stress, "cases", lambda seed: some)
    for strategy, code in (("LS", 1), ("FF", 0)):
        monkeypatch.setattr(sys, "argv", ["stress.py", "--strategy", strategy, "--output", str(tmp_path / "s.csv")])
        with pytest.raises(SystemExit) as done:
            stress.main()
        assert done.value.code == code
        assert ("failed: annulus" in capsys.readouterr().out) == (code == 1)
    assert len((tmp_path / "s.csv").read_text().splitlines()) == len(some) + 1


def test_comparison_with_gmsh(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["compare.py", str(SAMPLES / "plate.vtk")])
    compare.main()
    printed = capsys.readouterr().out
    assert printed.count("gmsh, unit edges") == printed.count("meshfix, best") == 4
    assert "error" not in printed
    monkeypatch.setattr(sys, "argv", ["compare.py", "--tets", "3000"])
    compare.main()
    assert capsys.readouterr().out.count("box with holes, P=10 D=1h") == 4


def test_scaling_is_measured_and_predicted(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pymetis", reason="without pymetis no mesh is shared among processes")
    scaling = pytest.importorskip("scaling")
    if shutil.which(scaling.MPIEXEC) is None:
        pytest.skip("there is no mpiexec: pip install mpich")
    monkeypatch.setattr(sys, "argv", ["scaling.py", "--tets", "20000", "--ranks", "1", "2", "--repeats", "1"])
    scaling.main()
    printed = capsys.readouterr().out
    assert all(words in printed for words in ("strong scaling", "weak scaling", "predicted, 1,000,000,000"))
