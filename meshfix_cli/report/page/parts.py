"""Parts that pages of reports share."""

from __future__ import annotations

import base64
import platform
from collections.abc import Iterable, Sequence
from hashlib import sha256
from html import escape
from importlib.metadata import PackageNotFoundError, version

from meshfix_cli.report.plain import plain

PACKAGES = ("meshfix-cli", "numpy", "scipy", "meshio")


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
