"""Writes what is told of formats into docs/files.md and README.md, between marks, from the tables of the package.

`make formats` runs it.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path

import meshio

from meshfix_cli.meshfile.formats import OWN, readers, writers
from meshfix_cli.meshfile.source import REGIONS

ROOT = Path(__file__).parent.parent
HEAD = ("format", "reads", "comes back whole", "regions and groups", "extra")
BEGIN, END = "<!-- formats -->", "<!-- end of formats -->"


def rows() -> list[tuple[str, ...]]:
    """Return a row for each format: those of the package by what they are called, then those of meshio."""
    own = [(f"{one.title} {_listed(one.extensions)}", one.reads, "yes", one.groups, one.extra) for one in OWN.values()]
    return [*sorted(own, key=lambda row: row[0].lower()), *(_of_meshio(name) for name in readers() if name not in OWN)]


def _of_meshio(name: str) -> tuple[str, ...]:
    taken = {extension for one in OWN.values() for extension in one.extensions}
    known = meshio.extension_to_filetypes.items()
    extensions = [one for one, names in known if name in names and one not in taken and not one.endswith(".gz")]
    regions = [one for one in REGIONS if one.startswith(f"{name}:")]
    text = Path(sys.modules[meshio._helpers.reader_map[name].__module__].__file__ or "").read_text(encoding="utf-8")
    needed = [f"`{package}`" for package in ("h5py", "netCDF4") if re.search(rf"import {package}\b", text)]
    whole = "no, it is written anew" if name in writers() else "no, it is only read"
    return f"{name} {_listed(extensions)}".strip(), "what meshio does", whole, _listed(regions), ", ".join(needed)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def table() -> str:
    """Return the table in Markdown."""
    lines = [HEAD, ("---",) * len(HEAD), *rows()]
    return "\n".join("".join(f"| {cell} " if cell else "| " for cell in line) + "|" for line in lines)


def extensions() -> str:
    """Return the extensions of the formats that come back whole, as a sentence has them."""
    *others, last = sorted({f"`{extension}`" for one in OWN.values() for extension in one.extensions})
    return textwrap.fill(f"{', '.join(others)} and {last}", 120)


def pages() -> dict[Path, str]:
    """Return the pages as they are to be."""
    made = {ROOT / "docs/files.md": table(), ROOT / "README.md": extensions()}
    return {page: _between(page, text) for page, text in made.items()}


def _between(page: Path, text: str) -> str:
    before, _, rest = page.read_text(encoding="utf-8").partition(f"{BEGIN}\n")
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{text}\n{END}{after}"


if __name__ == "__main__":
    for page, text in pages().items():
        page.write_text(text, encoding="utf-8")
