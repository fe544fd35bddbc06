"""Completion in bash, zsh and fish: click's, and that of `--option=value` as well. Imported where a shell asks."""

from __future__ import annotations

import os
from collections.abc import Iterable

from click.shell_completion import BashComplete, FishComplete, ZshComplete, add_completion_class, get_completion_class

from meshfix_cli.cli.process import COMPLETE

_TASKS = ("source", "complete")
_SIGNS = frozenset("=:")


@add_completion_class
class Bash(BashComplete):
    """Bash takes = and : for words of their own, and completes what is behind them."""

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the one that is completed, and what there is of that."""
        before, incomplete = super().get_completion_args()
        words, begun = _joined(before)
        if _is_sign(incomplete):  # nothing of the value is there
            begun, incomplete = True, ""
        if begun and words:
            option, _, _ = words.pop().partition("=")
            words += [option] if option.startswith("--") else []
        return words, incomplete


@add_completion_class
class Zsh(ZshComplete):
    """Zsh completes the whole word unless it is told where the value begins."""

    source_template = ZshComplete.source_template.replace(
        "    for type key", "    [[ $PREFIX == --*=* ]] && compset -P 1 '*='\n\n    for type key"
    ).replace("compadd -U", 'compadd -U -i "$IPREFIX"')


@add_completion_class
class Fish(FishComplete):
    """Fish completes the whole word, so that the option stands before each value."""

    source_template = FishComplete.source_template.replace(
        '--arguments "(%(complete_func)s)"',
        "--arguments \"(string replace -r -- '^' (string match -r -- '^--[^=]+=' (commandline -t); or echo '') "
        '(%(complete_func)s))"',
    )


def problem() -> str:
    """Say what is wrong with what a shell asks for, in one sentence; nothing: it can be answered."""
    shell, _, task = os.environ[COMPLETE].partition("_")
    if get_completion_class(shell) is None or task not in _TASKS:
        known = ", ".join(f"{one}_{_TASKS[0]}" for one in ("bash", "zsh", "fish"))
        return f"{COMPLETE} is {os.environ[COMPLETE]!r}, which asks for nothing that is known; there are {known}"
    if task == "complete":
        number = os.environ.get("COMP_CWORD", "")
        if "COMP_WORDS" not in os.environ or not (shell == "fish" or number.isdecimal()):
            return f"{COMPLETE} is {os.environ[COMPLETE]!r}, which only the shell may ask for, with COMP_WORDS"
    return ""


def _joined(words: Iterable[str]) -> tuple[list[str], bool]:
    """Return words as they were typed, and whether the last one ends with a sign."""
    found: list[str] = []
    begun = False
    for word in words:
        if found and (begun or _is_sign(word)):
            found[-1] += word
        else:
            found.append(word)
        begun = _is_sign(word)
    return found, begun


def _is_sign(word: str) -> bool:
    return bool(word) and _SIGNS.issuperset(word)
