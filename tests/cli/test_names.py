"""Names of files, fields, groups and sets: those that would act on a terminal, and those that are none."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import TANGLED, VALID, error_line, on_terminal, run
from files_pvtu import slabs, split
from places import SAMPLES
from shapes import block

NAME = os.fsdecode(b"a\xff\x1b[31m\n\xc2\x9b2J\xe2\x80\xae[b]<i>\x07")
SHOWN = r"a\xff\x1b[31m\n\x9b2J\u202e[b]<i>\x07"
ACTING = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
POSIX = pytest.mark.skipif(os.name != "posix", reason="names of POSIX")
ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"}


def printed(done: subprocess.CompletedProcess[bytes]) -> list[str]:
    """The lines of both streams, which must not act on a terminal."""
    text = (done.stdout + done.stderr).decode()
    assert not ACTING.search(text)
    return text.splitlines()


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    return Path(shutil.copy(TANGLED, tmp_path / f"{NAME}.vtk"))


@POSIX
def test_reports_and_errors_show_them_escaped(hostile: Path) -> None:
    lines = printed(run("quality", hostile, hostile.parent / f"none{NAME}", VALID, code=4))
    assert f"{hostile.parent}/{SHOWN}.vtk: 332 triangles, 207 vertices: 123 free, fixed 84 on the boundary" in lines
    (error,) = (line for line in lines if line.startswith("meshfix: error: "))
    assert f"none{SHOWN}: " in error
    verbose = printed(run("untangle", "--verbose", hostile, hostile.parent / f"o{NAME}.xyz"))
    assert any(line.startswith("smoothing 3: 0 inverted") for line in verbose)
    assert f"note: {hostile.parent}/o{SHOWN}.xyz: the extension .xyz is not known, so it is written as vtk" in verbose
    usage = printed(run("quality", "--report", f"{NAME}.pdf", hostile, code=2))
    assert usage[-1].startswith(f"Error: Invalid value for '--report': {SHOWN}.pdf: the name of a report")
    assert r"\x1b[31m" in printed(run(f"--no{NAME}", code=2))[-1]
    assert r"\x1b[31m" in printed(run("quality", f"--no{NAME}", hostile, code=2))[-1]


@POSIX
def test_a_terminal_gets_only_our_own_colours(hostile: Path, tmp_path: Path) -> None:
    code, shown = on_terminal("untangle", hostile, tmp_path / "o.vtk")
    assert code == 0
    assert f"{SHOWN}.vtk: 332 triangles" in shown
    assert "\x1b[31m" not in shown
    assert "\u202e" not in shown
    assert "\x9b" not in shown


@POSIX
def test_batches_tell_of_them_in_one_line_each(hostile: Path, tmp_path: Path) -> None:
    broken = tmp_path / f"broken{NAME}.vtk"
    broken.write_bytes(b"")
    report, page, out = tmp_path / f"{NAME}.json", tmp_path / f"{NAME}.html", tmp_path / f"out{NAME}"
    lines = printed(
        run("batch", "--report-json", report, "--report", page, hostile, broken, "--output-dir", out, code=4)
    )
    assert any(line.startswith(f"{tmp_path}/{SHOWN}.vtk: valid, 89 inverted -> 0") for line in lines)
    assert f"meshfix: error: {tmp_path}/broken{SHOWN}.vtk: is empty" in lines
    assert [one["file"] for one in json.loads(report.read_text())["files"]] == [str(hostile), str(broken)]
    assert "\x1b" not in page.read_text(encoding="utf-8")
    done = run("batch", "--json", hostile, "--output-dir", out)
    assert json.loads(done.stdout)["output"] == str(out / hostile.name)


@POSIX
@pytest.mark.parametrize("environment", [{}, ASCII])
def test_files_that_are_written_beside_a_mesh(
    environment: dict[str, str], hostile: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    beside = {"--history": ".csv", "--cells": ".vtu", "--report": ".html"}
    for plot in (".png", ".svg", ".pdf"):
        targets = {option: hostile.parent / f"beside{NAME}{extension}" for option, extension in beside.items()}
        targets["--plot"] = hostile.parent / f"beside{NAME}{plot}"
        words = [word for pair in targets.items() for word in pair]
        assert json.loads(run("untangle", "--json", *words, hostile, hostile.parent / f"o{NAME}.vtk").stdout)["valid"]
        for target in targets.values():
            assert target.stat().st_size > 100
            target.rename(hostile.parent / f"kept{target.suffix}")
    page = (hostile.parent / "kept.html").read_text(encoding="utf-8")
    assert not ACTING.search(page)
    assert r"a\xff\x1b[31m\n" in page
    assert printed(run("quality", hostile, code=3))


@POSIX
def test_pieces_whose_name_xml_cannot_hold(tmp_path: Path) -> None:
    points, cells = block()
    path = split(tmp_path / "in.pvtu", points, cells, slabs(points, cells, 2))
    before = sorted(tmp_path.iterdir())
    for name in (NAME, "a\x1b", os.fsdecode(b"\xff")):
        assert "its name holds what XML cannot" in error_line("untangle", path, tmp_path / f"{name}.pvtu")
    assert sorted(tmp_path.iterdir()) == before


def test_groups_fields_and_sets(tmp_path: Path) -> None:
    groups = tmp_path / "groups.msh"
    groups.write_bytes((SAMPLES / "two_materials.msh").read_bytes().replace(b'"steel"', b'"st\x1b[2J\xc2\x9bel"'))
    lines = printed(run("untangle", groups, tmp_path / "out.vtu"))
    assert any(r"dropped: group st\x1b[2J\x9bel, comments" in line for line in lines)

    fields = tmp_path / "fields.vtk"
    mesh = meshio.read(VALID)
    left = mesh.points[mesh.cells[0].data].mean(axis=1)[:, 0] < 1.5
    marked = meshio.Mesh(
        mesh.points, mesh.cells, {"fi%1b[2Jx": np.zeros(len(mesh.points))}, {"p%0aart": [left.astype(float)]}
    )
    marked.write(fields, file_format="vtk42", binary=False)
    assert r"between regions of p\nart" in printed(run("quality", "--regions", "p\nart", fields))[0]
    assert r"(found: fi\x1b[2Jx)" in error_line("quality", "--fix", "none", fields)
    assert r"(found: p\nart)" in error_line("quality", "--regions", "no\x1b[2Jne", fields)

    sets = tmp_path / "sets.inp"
    sets.write_bytes(
        b"*NODE\n1, 0, 0\n2, 1, 0\n3, 0, 1\n*ELEMENT, TYPE=CPS3, ELSET=A\n1, 1, 2, 3\n"
        b"*SOLID SECTION, ELSET=ST\x1b[2JEEL, MATERIAL=S\n"
    )
    assert not ACTING.search(error_line("quality", sets))


@pytest.mark.parametrize(
    "arguments",
    [
        ["quality", ""],
        ["quality", VALID, ""],
        ["untangle", ""],
        ["untangle", VALID, ""],
        ["perturb", "--percent", "1", "--dist", "h", "", "o.vtk"],
        ["batch", "", "--output-dir", "out"],
        *([command, option, "", VALID] for command in ("untangle", "quality") for option in ("--cells", "--report")),
        ["perturb", "--percent", "1", "--dist", "h", "--plot", "", VALID, "o.vtk"],
        ["untangle", "--history", "", VALID, "o.vtk"],
        *(["batch", option, "", VALID, "--output-dir", "out"] for option in ("--report", "--files-from")),
        ["quality", "--report-json", "", VALID],
        ["batch", "--executor", "dask", "--scheduler-file", "", VALID, "--output-dir", "out"],
        ["batch", VALID, "--output-dir", ""],
    ],
)
def test_an_empty_name_is_wrong_usage(arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    kind = "folder" if arguments[-2:] == ["--output-dir", ""] else "file"
    assert error_line(*arguments, code=2).endswith(f": the name of a {kind} is empty")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "name", "words"),
    [
        ("--report", "r.pdf", "a report ends in .html or .htm; --report-json writes it as JSON"),
        ("--report", "x.json", "a report ends in .html or .htm; --report-json writes it as JSON"),
        ("--report-json", "x.html", "a report as JSON ends in .json"),
        ("--plot", "p.gif", "a plot ends in .png, .svg or .pdf"),
        ("--plot", "plot", "a plot ends in .png, .svg or .pdf"),
        ("--cells", "c.obj", "a file of cells ends in .vtu or .vtk"),
        ("--history", "h.xlsx", "a history ends in .csv"),
    ],
)
def test_the_extension_tells_what_is_written_beside_a_mesh(
    option: str, name: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    of_all: dict[str, list[object]] = {
        "untangle": [VALID, "o.vtk"],
        "perturb": ["--percent", 1, "--dist", "h", VALID, "o.vtk"],
        "quality": [VALID],
    }
    only = {"--cells": ("untangle", "quality"), "--history": ("untangle",)}
    for command in only.get(option, of_all):
        line = error_line(command, option, name, *of_all[command], code=2)
        assert line == f"Error: Invalid value for '{option}': {name}: the name of {words}"
    assert list(tmp_path.iterdir()) == []


def test_names_without_an_extension_or_in_capitals(tmp_path: Path) -> None:
    beside = ["--history", tmp_path / "H.CSV", "--report", tmp_path / "page", "--cells", tmp_path / "C.Vtu"]
    run("untangle", "-q", *beside, TANGLED, tmp_path / "o")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["C.Vtu", "H.CSV", "o", "page"]
    assert (tmp_path / "page").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_an_unknown_extension_of_the_output_is_told(tmp_path: Path) -> None:
    def notes(*arguments: object) -> list[str]:
        done = run(*arguments, "--json")
        return [note for note in json.loads(done.stdout or done.stderr)["notes"] if "extension" in note]

    odd = tmp_path / "a.xyz"
    told = "the extension .xyz is not known, so it is written as vtk"
    assert notes("untangle", TANGLED, odd) == [f"{odd}: {told}"]
    assert notes("perturb", "--percent", 9, "--dist", "h", odd, tmp_path / "b.abc.gz") == [
        f"{tmp_path / 'b.abc.gz'}: the extension .abc is not known, so it is written as vtk"
    ]
    ucd, shared = tmp_path / "c.ucd", tmp_path / "c.inp"
    assert notes("untangle", TANGLED, ucd) == []
    told = "the extension is also that of abaqus; it is written as avsucd, as the input is"
    assert notes("untangle", ucd, shared) == [f"{shared}: {told}"]
    assert notes("untangle", shared, tmp_path / "d.inp") == notes("untangle", ucd, shared, "--format", "abaqus") == []
    for target in (odd, tmp_path / "c.xyz", tmp_path / "c.vtu", tmp_path / "c"):
        assert notes("untangle", odd, target) == []
    assert notes("untangle", "--format", "obj", TANGLED, tmp_path / "d.foo") == []
    assert notes("untangle", "--dry-run", TANGLED, tmp_path / "d.bar") == []
