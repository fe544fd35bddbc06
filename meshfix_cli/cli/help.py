"""Help in groups of options, with examples at its end."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from typing import Any

import click

# In the order in which they stand in the help and in the manual pages.
HEADINGS = (IN_OUT, METHOD, FREEDOM, QUALITY, REPORT, PROCESS) = (
    "Input and output",
    "Method",
    "What may move",
    "Quality",
    "Report",
    "Process",
)

Examples = tuple[tuple[str, str], ...]  # what is done, and the command that does it


class Option(click.Option):
    """An option that stands under a heading of the help."""

    def __init__(self, *names: Any, heading: str, **more: Any) -> None:
        super().__init__(*names, **more)
        self.heading = heading


def under(heading: str, *names: str, **more: Any) -> Callable[..., Any]:
    """Return the decorator that adds an option under a heading; see `click.option`."""
    return click.option(*names, cls=Option, heading=heading, **more)


def heading_of(parameter: click.Parameter) -> str:
    """Return under which heading an option stands: --help, which click makes, under the last."""
    return parameter.heading if isinstance(parameter, Option) else HEADINGS[-1]


class WithExamples(click.Command):
    """A command whose help ends with examples."""

    def __init__(self, *arguments: Any, examples: Examples = (), **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.examples = examples

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples; commands are not broken, so that they can be copied."""
        with formatter.section("Examples"):
            for what, command in self.examples:
                formatter.write_text(f"{what}:")
                formatter.write(f"{'':{formatter.current_indent + 2}}$ {command}\n")


class Command(WithExamples):
    """A command whose options stand under headings."""

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.params.sort(key=_place)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under their headings."""
        parameters = (one for one in self.get_params(ctx) if isinstance(one, click.Option))
        for heading, options in groupby(parameters, heading_of):
            with formatter.section(heading):
                formatter.write_dl([record for one in options if (record := one.get_help_record(ctx))])


def _place(parameter: click.Parameter) -> int:
    """Return where a parameter stands among others: arguments first, then options by their headings."""
    return HEADINGS.index(heading_of(parameter)) if isinstance(parameter, click.Option) else -1
