"""The report on a batch as one HTML file; it needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from meshfix_cli.mesh.elements import counted
from meshfix_cli.report.page.parts import filled, framed, made, shown, table
from meshfix_cli.report.tally import STATUSES, Tally, smallest, why

WORST_FIRST = ("invalid", "valid", "skipped")
COLUMNS = ("file", "outcome", "elements", "inverted", "still", "smallest angle or scaled Jacobian", "after", "seconds")

Kept = Mapping[str, Any]


def page_of_many(files: Sequence[Kept], total: int, tally: Tally, options: Mapping[str, str]) -> str:
    """Return the HTML.

    Parameters
    ----------
    files : sequence of mapping
        What `tally.kept` gives of each that is done.
    total : int
        How many there are.
    tally : Tally
        Of those that are done.
    options : mapping
        Those of the command line and their values.
    """
    done = len(files) == total
    good = all(one["status"] in ("valid", "skipped") and not _not_met(one) for one in files)
    left = "" if done else f", of which {counted(total - len(files), 'was', 'were')} not begun or not done"
    verdict = "All are valid" if good and done else "Stopped" if good else "Not all are valid"
    every = table("Before and after", ["", "before", "after"], tally.rows())
    return framed(
        good and done,
        command="batch",
        heading=shown(f"{counted(total, 'mesh', 'meshes')}{left}"),
        verdict=f"<p><strong>{verdict}</strong></p>",
        content=filled("many.html", all=every, each="".join(_each(files))),
        made=made((name, [value]) for name, value in options.items()),
    )


def _each(files: Sequence[Kept]) -> Iterator[str]:
    """Yield a table of the meshes that could not be repaired, and one of the others, the worst first."""
    failed = [(one["file"], [why(one)]) for one in files if one["status"] == "failed"]
    if failed:
        yield table("Failed", ["file", "why"], failed, "words")
    others = sorted(
        (one for one in files if one["status"] != "failed"), key=lambda one: WORST_FIRST.index(one["status"])
    )
    if others:
        yield table("Repaired", COLUMNS, [(one["file"], _row(one)) for one in others])
    unmet = [(one["file"], [", ".join(_not_met(one))]) for one in others if _not_met(one)]
    if unmet:
        yield table("Requirements that are not met", ["file", "required"], unmet, "words")


def _row(one: Kept) -> list[str]:
    stages = one["before"], one["after"]
    inverted = [f"{stage['inverted']:,}" if stage else "" for stage in stages]
    worst = [smallest(stage) if stage else "" for stage in stages]
    return [STATUSES[one["status"]], f"{one['elements']:,}", *inverted, *worst, f"{one['seconds']:.3g}"]


def _not_met(one: Kept) -> list[str]:
    return [asked["requirement"] for asked in one["requirements"] or () if not asked["met"]]
