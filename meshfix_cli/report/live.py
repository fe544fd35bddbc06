"""What a run does, as it does it: on a terminal one line, which is gone at the end. Imported where there is one."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from meshfix_cli.report.plain import plain

if TYPE_CHECKING:
    from rich.console import Console

BAR, NARROW = 20, 70  # columns: of the bar, which narrower terminals do without
A_SECOND = 10  # times that the line is drawn


class Line:
    """One line: a bar, how long it has taken, and what is done.

    Parameters
    ----------
    out : Console
        A terminal.
    """

    def __init__(self, out: Console) -> None:
        self._start, self._what = time.monotonic(), ""
        self._share: float | None = None
        self._spinner, self._wide = Spinner("dots"), out.width >= NARROW
        self._live = Live(
            console=out, get_renderable=self._row, refresh_per_second=A_SECOND, transient=True,
            redirect_stdout=False, redirect_stderr=False,  # older releases put there what is no terminal
        )  # fmt: skip

    def show(self, what: str, share: float | None = None) -> None:
        """Show what is done, and which share of it, where that is known."""
        self._what, self._share = what, share
        self._live.start()

    def hide(self) -> None:
        """Take the line away until there is more to be shown."""
        self._live.stop()

    def _row(self) -> Table:
        row = Table.grid(padding=(0, 1))
        for _ in range(4 if self._wide else 2):
            row.add_column(no_wrap=True)
        row.add_column(no_wrap=True, overflow="ellipsis")
        minutes, seconds = divmod(int(time.monotonic() - self._start), 60)
        known = self._share is not None
        bar = ProgressBar(total=1.0 if known else None, completed=self._share or 0.0, width=BAR, pulse=not known)
        share = f"{self._share:4.0%}" if self._share is not None else ""
        more: list[Any] = [bar, Text(share)] if self._wide else []
        row.add_row(self._spinner, Text(f"{minutes}:{seconds:02}"), *more, Text(plain(self._what)))
        return row
