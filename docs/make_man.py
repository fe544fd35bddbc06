"""Makes the manual pages in a folder of the help: those of click-man, with options under headings, and with examples.

`make man` runs it: make_man.py FOLDER DATE.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import click
from click_man.core import generate_man_page

from meshfix_cli import __version__
from meshfix_cli.cli import main
from meshfix_cli.cli.help import Command, Examples, WithExamples, heading_of


def pages(date: str) -> Iterator[tuple[str, str]]:
    """Yield the name of each page and what is in it."""
    top = click.Context(main, info_name="meshfix")
    yield _page(top, date)
    for name, command in main.commands.items():
        yield _page(click.Context(command, info_name=name, parent=top), date)


def _page(ctx: click.Context, date: str) -> tuple[str, str]:
    text = generate_man_page(ctx, version=__version__, date=date)
    command = ctx.command
    assert isinstance(command, WithExamples)
    if isinstance(command, Command):
        text = _with_headings(text, command)
    return f"{ctx.command_path.replace(' ', '-')}.1", text + _examples(command.examples)


def _with_headings(text: str, command: Command) -> str:
    """Put a heading before the first option of each group; they are on the page in the order of the parameters."""
    head, *entries = text.split("\n.TP\n")
    options = [one for one in command.params if isinstance(one, click.Option)]
    last = None
    for option, entry in zip(options, entries, strict=True):
        heading = heading_of(option)
        head += f"\n.SS {heading}" * (heading != last) + f"\n.TP\n{entry}"
        last = heading
    return head


def _examples(examples: Examples) -> str:
    lines = [".SH EXAMPLES"]
    for what, command in examples:
        escaped = command.replace("\\", r"\e").replace("-", r"\-").replace("'", r"\(aq")
        lines += [".PP", f"{what}:", ".PP", ".nf", ".RS", rf"\fB{escaped}\fP", ".RE", ".fi"]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    for _name, _text in pages(sys.argv[2]):
        (Path(sys.argv[1]) / _name).write_text(_text, encoding="utf-8")
