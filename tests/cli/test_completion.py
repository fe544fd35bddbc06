"""Completion in the shells themselves, as a user types."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from commands import VALID, error_line
from places import ROOT
from shells import SETUP, Shell, shell

from meshfix_cli.cli import completion, main
from meshfix_cli.cli.names import Name
from meshfix_cli.cli.process import COMPLETE
from meshfix_cli.solve.strategies import STRATEGIES

NAMES = ("tangled.vtk", "wing with tail.vtk", "report.html")
# What is typed, and the word that completion makes of the last.
COMPLETED = (
    ("meshfix unt", "untangle"),
    ("meshfix untangle tang", "tangled.vtk"),
    ("meshfix untangle tangled.vtk wing", "wing with tail.vtk"),
    ("meshfix quality tangled.vtk wing", "wing with tail.vtk"),
    ("meshfix batch tang", "tangled.vtk"),
    ("meshfix perturb sub/in", "sub/inner.vtk"),
    ("meshfix untangle --refe", "--reference"),
    ("meshfix untangle --strategy LU", "LUS"),
    ("meshfix untangle --strategy=LU", "--strategy=LUS"),
    ("meshfix untangle --smooth 3 --slide cu", "curved"),
    ("meshfix untangle --format dolf", "dolfin-xml"),
    ("meshfix quality --metric=aspect", "--metric=aspect_ratio"),
    ("meshfix untangle --report=report.html tang", "tangled.vtk"),
    ("meshfix untangle --report=rep", "--report=report.html"),
    ("meshfix untangle -o tang", "tangled.vtk"),
    ("meshfix untangle --fix a=b tang", "tangled.vtk"),
    ("meshfix untangle --fix zone:1 --slide=cu", "--slide=curved"),
    ("meshfix untangle --require min_angle==5 tang", "tangled.vtk"),
    ("meshfix untangle a=b.vtk --slide cu", "curved"),
)
# What bash says of a line: the words before the one that is completed, that, and what click is to take them for.
IN_BASH: tuple[tuple[str, str, list[str]], ...] = (
    ("untangle --fix = ", "", ["untangle", "--fix"]),
    ("untangle --fix =", "=", ["untangle", "--fix"]),
    ("untangle --fix = a :", "b", ["untangle", "--fix"]),
    ("untangle --fix = a", ":", ["untangle", "--fix"]),
    ("untangle a = b --require min_angle == 5", "x", ["untangle", "a=b", "--require", "min_angle==5"]),
    ("untangle q =", "r", ["untangle"]),
    ("", "=", []),
)


def options(kind: str) -> Iterator[str]:
    """What is typed for each option that takes a file, or a folder."""
    for name, command in main.commands.items():
        for parameter in command.params:
            if isinstance(parameter, click.Option) and isinstance(parameter.type, Name) and parameter.type.kind == kind:
                yield f"meshfix {name} {parameter.opts[0]} "


@pytest.fixture(params=["bash", "zsh", "fish"])
def typed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Shell]:
    folder = tmp_path / "work"
    (folder / "sub").mkdir(parents=True)
    for name in (*NAMES, "sub/inner.vtk"):
        shutil.copy(VALID, folder / name)
    with shell(request.param, folder) as ready:
        yield ready


def test_names_and_choices_are_completed(typed: Shell) -> None:
    for line, word in COMPLETED:
        assert typed.completed(line)[-1] == word, line


def test_each_option_for_a_file_completes_files(typed: Shell) -> None:
    lines = list(options("file"))
    assert len(lines) > 12
    for line in lines:
        assert typed.completed(f"{line}tang")[-1] == "tangled.vtk", line
    (line,) = options("folder")
    assert typed.completed(f"{line}su")[-1].rstrip("/") == "sub"


def test_choices_are_shown(typed: Shell) -> None:
    typed.wait_for_offer("meshfix untangle --strategy ", *STRATEGIES)
    typed.wait_for_offer("meshfix untangle ", *NAMES[1].split(), NAMES[2])


def test_the_readme_says_how() -> None:
    """In the words that the tests use."""
    told = (ROOT / "README.md").read_text()
    assert all(words in told for words in (SETUP["bash"], SETUP["fish"], "`zsh_source` behind `compinit`"))


def test_what_takes_a_file_is_known_to_shells() -> None:
    """Whatever is called a file or a folder in the help."""
    for command in main.commands.values():
        for parameter in command.params:
            called = str(parameter.metavar or "").strip("[].")
            if called.startswith(("FILE", "DIR", "INPUT", "OUTPUT")) or called == "IN":
                assert isinstance(parameter.type, Name), parameter.name


@pytest.mark.parametrize(("before", "incomplete", "words"), IN_BASH)
def test_bash_parts_words_at_signs(
    before: str, incomplete: str, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = ["meshfix", *before.split(), *incomplete.split()]
    monkeypatch.setenv("COMP_WORDS", "\n".join(given))
    monkeypatch.setenv("COMP_CWORD", str(1 + len(before.split())))
    left = "" if incomplete in ("=", ":") else incomplete
    assert completion.Bash(main, {}, "meshfix", COMPLETE).get_completion_args() == (words, left)


@pytest.mark.parametrize(
    "asked", ["bash", "bash_sourc", "csh_source", "bash_complete", "zsh_complete", "fish_complete"]
)
def test_what_no_shell_asks_for_is_one_sentence(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_MESHFIX_COMPLETE", asked)
    assert error_line().startswith(f"meshfix: error: _MESHFIX_COMPLETE is '{asked}', which ")
    monkeypatch.setenv("_MESHFIX_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", "meshfix unt")
    monkeypatch.setenv("COMP_CWORD", "x")
    assert error_line().startswith("meshfix: error: _MESHFIX_COMPLETE is 'bash_complete', which only the shell may")
