"""The names of files that commands get: none is empty, and the extension is one of what will be in the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click


class Name(click.Path):
    """A file or a folder, which shells complete; whether it is there and may be used, its reader or writer tells.

    Parameters
    ----------
    kind : {"file", "folder"}
    """

    def __init__(self, kind: str = "file") -> None:
        super().__init__(file_okay=kind == "file", readable=False, allow_dash=True)  # what is replaced need not be
        self.kind = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse an empty name, which would be that of the folder one is in."""
        return value or self.fail(f"the name of a {self.kind} is empty", param, ctx)


class Written(Name):
    """A file of a kind that its extension tells.

    Parameters
    ----------
    what : str
        What is written, with an article.
    extensions : callable
        Returns those that it may have; called where a name has one.
    bare : bool
        A name may have none.
    hint : str
        What else a user may have meant.
    """

    def __init__(self, what: str, extensions: Callable[[], Sequence[str]], bare: bool = True, hint: str = "") -> None:
        super().__init__()
        self._what, self._extensions, self._bare, self._hint = what, extensions, bare, hint

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse other extensions; that "-" is no file is told where it is looked at what the name is."""
        name = super().convert(value, param, ctx)
        extension = Path(name).suffix.lower()
        if name == "-" or (self._bare and not extension):
            return name
        *others, last = known = self._extensions()
        if extension in known:
            return name
        choice = f"{', '.join(others)} or {last}" if others else last
        return self.fail(f"{name}: the name of {self._what} ends in {choice}{self._hint}", param, ctx)


def _plots() -> Sequence[str]:
    from meshfix_cli.report.plot import METADATA

    return tuple(METADATA)


def _cells() -> Sequence[str]:
    from meshfix_cli.meshfile.writing import cells_extensions

    return cells_extensions()


FILE, FOLDER = Name(), Name("folder")
PAGE = Written("a report", lambda: (".html", ".htm"), hint="; --report-json writes it as JSON")
JSON = Written("a report as JSON", lambda: (".json",))
PLOT = Written("a plot", _plots, bare=False)
HISTORY = Written("a history", lambda: (".csv",))
CELLS = Written("a file of cells", _cells)
