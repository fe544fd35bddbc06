"""Each entry of each table has its documentation and its tests."""

from __future__ import annotations

import importlib
import re
from dataclasses import fields

import make_formats
import pytest
from places import ROOT

from meshfix_cli.cli.untangle import untangle as command
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.formats import OWN, readers
from meshfix_cli.quality import corners, simplices
from meshfix_cli.quality.metrics import METRICS, NUMBERS
from meshfix_cli.quality.requirement import Requirement
from meshfix_cli.quality.summary import Summary
from meshfix_cli.solve.strategies import STRATEGIES, Move

DOCS, TESTS, PACKAGE = ROOT / "docs", ROOT / "tests", ROOT / "meshfix_cli"
README = (ROOT / "README.md").read_text()


def first_column(page: str, *, heading: str) -> list[str]:
    """The names in code that begin the rows of a page's tables, behind a heading."""
    text = (DOCS / page).read_text().partition(heading)[2]
    return re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)


@pytest.mark.parametrize("name", OWN)
def test_formats(name: str) -> None:
    module = importlib.import_module(f"meshfix_cli.meshfile.{OWN[name].module}")
    told = module.__doc__ or ""
    assert len(told.splitlines()) >= 3, "the docstring tells how the coordinates lie"
    assert "Source:" in told, "the docstring names what describes the format"
    assert all((OWN[name].title, OWN[name].reads, OWN[name].groups)), "what docs/files.md says of it"
    assert all(f"`{extension}`" in README for extension in OWN[name].extensions), "README.md"
    word = name.replace("-", "_")
    assert (TESTS / f"meshfile/test_{word}.py").exists()
    assert hasattr(importlib.import_module(f"files_{word}"), "read_independently")


def test_pages_tell_of_the_formats_that_there_are() -> None:
    for page, text in make_formats.pages().items():
        assert page.read_text() == text, "make formats makes it again"
        assert make_formats.BEGIN in text
    names = [row[0] for row in make_formats.rows()]
    assert len(names) == len(set(names)) == len(readers())
    assert all(len(row) == len(make_formats.HEAD) for row in make_formats.rows())
    assert all(title.count("`") for title in names[: len(OWN)])


def test_strategies() -> None:
    assert first_column("method.md", heading="# Method") == list(STRATEGIES)
    told = command.help or ""
    assert all(re.search(rf"\b{name}\b", told) for name in STRATEGIES), "the help of untangle"
    assert 'parametrize("strategy", STRATEGIES)' in (TESTS / "solve/test_untangle.py").read_text()


def test_metrics() -> None:
    assert first_column("quality.md", heading="## Metrics") == list(METRICS)
    for module in (simplices, corners):
        functions = [
            name for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__
        ]
        public = {name for name in functions if not name.startswith("_")} - {"numbered"}
        assert public == set(METRICS), "all have each: quadrilaterals are among the others"
    assert 'parametrize("name", METRICS)' in (TESTS / "quality/test_metrics.py").read_text()
    assert "for name, metric in METRICS.items()" in (TESTS / "quality/test_corners.py").read_text()


def test_numbers_that_a_requirement_can_name() -> None:
    assert list(NUMBERS) == [field.name for field in fields(Summary) if field.type in ("int", "float")]
    for name in (*NUMBERS, *METRICS):
        assert Requirement.parse(f"{name} >= 0").name == name


def test_moves() -> None:
    assert first_column("extending.md", heading="## A move") == [move.name for move in Move]
    assert 'parametrize("move", list(Move))' in (TESTS / "kernels/test_kernels.py").read_text()
    code = (PACKAGE / "kernels/moves/relocate.hpp").read_text()
    names = re.findall(r"\w+", code.partition("enum class Move : int {")[2].partition("}")[0])
    assert names == [move.name.lower() for move in Move]
    assert [move.value for move in Move] == list(range(len(Move)))


def test_elements() -> None:
    rows = re.findall(r"^\| (\w[^|]*) \| `(\w+)` \| (\w+) \| (\d*) \| (\d*) \| (solved|by its corners|held) \|$",
                      (DOCS / "elements.md").read_text(), re.MULTILINE)  # fmt: skip
    expected = [
        (one.shape.name, key, str(one.nodes or "any"), str(one.vtk or ""), str(one.gmsh or ""),
         "solved" if one.judged_by else "by its corners" if one.straight else "held")
        for key, one in ELEMENTS.items()
    ]  # fmt: skip
    assert rows == expected


def test_rooms() -> None:
    """The page for newcomers names the rooms that there are."""
    rooms = re.findall(r"^\| `([\w.]+)/?` \|", (DOCS / "extending.md").read_text(), re.MULTILINE)
    rooms = [room for room in rooms if room not in Move.__members__]
    there = {path.name for path in PACKAGE.iterdir() if path.is_dir()} - {"__pycache__"}
    assert set(rooms) == there
