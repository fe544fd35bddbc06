"""What a wheel says of itself is so: the Pythons that its tag names are those that can load its modules."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from places import ROOT

STABLE = (3, 12)  # from this release of Python on, one build is for all later ones
MADE = os.environ.get("MESHFIX_WHEEL")  # by this Python, which may so be judged without being made once more
NEWER = ("python3.14", "python3.13", "python3.12")


def runs(python: str) -> bool:
    """Whether a Python is there, and has a pip."""
    try:
        return subprocess.run([python, "-m", "pip", "--version"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def wheel_made_by(python: str, folder: Path) -> Path:
    """A wheel, made as pip makes it, with whatever CMake is there; both builds of the kernels are made alike."""
    command = [
        python, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(folder), str(ROOT),
        "--config-settings=cmake.define.MESHFIX_AVX2=OFF",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "No matching distribution found" in done.stderr:
        pytest.skip("no package index answers, and the build needs what it builds with")
    assert done.returncode == 0, done.stderr
    (made,) = folder.glob("*.whl")
    return made


@pytest.mark.parametrize("which", ["this Python", "one that has a stable ABI"])
def test_the_tag_is_that_of_the_modules_and_their_source_stays_at_home(which: str, tmp_path: Path) -> None:
    python = sys.executable
    if which != "this Python":
        python = "" if sys.version_info >= STABLE else next(filter(runs, NEWER), "")
        if not python:
            pytest.skip("there is no other Python that has a stable ABI")
    wheel = Path(MADE) if MADE and python == sys.executable else wheel_made_by(python, tmp_path)
    names = zipfile.ZipFile(wheel).namelist()
    modules = [name for name in names if name.endswith((".so", ".pyd"))]
    assert any(Path(name).name.startswith("_any.") for name in modules)
    stable = [name for name in modules if ".abi3." in name or name.count(".") == 1]  # Windows: _any.pyd
    assert stable == (modules if wheel.stem.split("-")[3] == "abi3" else [])
    assert "meshfix_cli/kernels/__init__.pyi" in names
    assert [name for name in names if name.endswith((".cpp", ".hpp", "CMakeLists.txt"))] == []
