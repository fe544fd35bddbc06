"""Parts that pages of reports share."""

from __future__ import annotations

import base64
import platform
from collections.abc import Iterable, Sequence
from hashlib import sha256
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from string import Template

from meshfix_cli.report.plain import plain

PACKAGES = ("meshfix-cli", "numpy", "scipy", "meshio")


def filled(name: str, **parts: str) -> str:
    """Return what stands in a file of this folder, with its parts in their places."""
    return Template(read(name)).substitute(parts)


def read(name: str) -> str:
    """Return a file of this folder."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def framed(good: bool, script: str = "", data: str = "", **parts: str) -> str:
    """Return a page.

    Parameters
    ----------
    good : bool
        The colour of the verdict.
    script : str
        What runs in it.
    data : str
        Elements that the script reads.
    parts : str
        HTML: `command`, `heading`, `verdict`, `content` and `made`; `subject` is below the heading, `lead` below the
        verdict.
    """
    style = read("style.css")
    return filled(
        "frame.html",
        style=style,
        style_hash=hash_of(style),
        script_policy=f" script-src '{hash_of(script)}';" if script else "",
        outcome="valid" if good else "wrong",
        scripts=f"{data}<script>{script}</script>\n" if script else "",
        **{"subject": "", "lead": "", **parts},
    )


def shown(text: str) -> str:
    """Return text for the page, which shows it and does nothing else with it."""
    return escape(plain(text))


def hash_of(text: str) -> str:
    """Return what allows a style or a script in the policy of the page."""
    return f"sha256-{base64.b64encode(sha256(text.encode()).digest()).decode()}"


def table(caption: str, columns: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]], style: str = "") -> str:
    """Return a table of text."""
    first, *others = (shown(column) for column in columns)
    corner = f'<th scope="col">{first}</th>' if first else "<td></td>"
    head = corner + "".join(f'<th scope="col">{column}</th>' for column in others)
    body = "".join(
        f'<tr><th scope="row">{shown(name)}</th>{"".join(f"<td>{shown(cell)}</td>" for cell in cells)}</tr>'
        for name, cells in rows
    )
    return scrolled(caption, f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>", style)


def scrolled(caption: str, content: str, style: str = "") -> str:
    """Return a table of rows that are HTML, which scrolls by itself where the page is narrower."""
    return (
        f'<div class="wide" role="region" tabindex="0" aria-label="{shown(caption)}">'
        f'<table class="{style}"><caption>{shown(caption)}</caption>{content}</table></div>'
    )


def made(lines: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Return a table of what a report was made with, and by which versions."""
    versions = [(package, [_version(package)]) for package in PACKAGES]
    python = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    return table("Options and versions", ["", "value"], [*lines, *versions, ("Python", [python])], "words")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed as a package"
