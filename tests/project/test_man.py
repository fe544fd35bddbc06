"""The manual pages are those that `make man` makes of the help, and are installed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

PAGES = sorted((ROOT / "man").glob("*.1"))


def test_pages_are_made_of_the_help(tmp_path: Path) -> None:
    pytest.importorskip("click_man", reason="click-man is not installed")
    released = re.search(r"^RELEASED := (\S+)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert released is not None
    command = [Path(sys.executable).with_name("click-man"), "--target", tmp_path, "--man-date", released[1], "meshfix"]
    subprocess.run(command, check=True, capture_output=True)
    assert [page.name for page in PAGES] == sorted(page.name for page in tmp_path.iterdir())
    for page in PAGES:
        assert page.read_text() == (tmp_path / page.name).read_text(), "make man makes them again"


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
