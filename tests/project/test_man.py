"""The manual pages are those that `make man` makes of the help, and are installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from places import ROOT

from meshfix_cli.cli import main
from meshfix_cli.cli.help import Command, WithExamples, heading_of

PAGES = sorted((ROOT / "man").glob("*.1"))


def test_pages_are_made_of_the_help(tmp_path: Path) -> None:
    pytest.importorskip("click_man", reason="click-man is not installed")
    released = re.search(r"^RELEASED := (\S+)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert released is not None
    subprocess.run([sys.executable, ROOT / "docs/make_man.py", tmp_path, released[1]], check=True)
    assert [page.name for page in PAGES] == sorted(page.name for page in tmp_path.iterdir())
    for page in PAGES:
        assert page.read_text() == (tmp_path / page.name).read_text(), "make man makes them again"


def test_options_stand_under_headings_and_examples_at_the_end() -> None:
    for page in PAGES:
        text = page.read_text()
        command = main.commands.get(page.stem.partition("-")[2], main)
        assert isinstance(command, WithExamples)
        headings = list(dict.fromkeys(heading_of(one) for one in command.params if isinstance(one, click.Option)))
        assert re.findall(r"^\.SS (.+)$", text, re.MULTILINE) == (headings if isinstance(command, Command) else [])
        assert re.findall(r"^\.SH (.+)$", text, re.MULTILINE)[-1] == "EXAMPLES"
        assert text.count(".nf\n") == len(command.examples) > 0


@pytest.mark.skipif(not shutil.which("man"), reason="there is no man")
def test_man_shows_examples_as_they_are_typed() -> None:
    for page in PAGES:
        command = main.commands.get(page.stem.partition("-")[2], main)
        environment = {**os.environ, "MANWIDTH": "200", "LC_ALL": "C.UTF-8"}
        done = subprocess.run(["man", "-P", "cat", page], capture_output=True, check=True, env=environment)
        assert not done.stderr
        assert isinstance(command, WithExamples)
        for _, line in command.examples:
            assert line in re.sub(".\x08", "", done.stdout.decode()), "copied from there, it runs"


def test_no_summary_is_cut_short() -> None:
    for page in PAGES:
        text = page.read_text()
        name, commands = text.partition(".SH NAME\n")[2], text.partition(".SH COMMANDS\n")[2]
        assert name.partition("\n")[0].endswith(".")
        assert "..." not in name.partition("\n")[0] + commands


def test_pages_are_installed_where_man_looks() -> None:
    for page in PAGES:
        assert (Path(sys.prefix) / "share/man/man1" / page.name).read_text() == page.read_text(), (
            "make .venv/developer installs them"
        )
