"""Completion in bash, zsh and fish: click's, and that of `--option=value` as well. Imported where a shell asks."""

from __future__ import annotations

from collections.abc import Iterator

from click.shell_completion import BashComplete, FishComplete, ZshComplete, add_completion_class


@add_completion_class
class Bash(BashComplete):
    """Bash takes the = for a word of its own."""

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the one that is completed, and what there is of that."""
        words, incomplete = super().get_completion_args()
        return list(_without_signs(words)), "" if incomplete == "=" else incomplete  # nothing of the value is there


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


def _without_signs(words: list[str]) -> Iterator[str]:
    """Leave out each = behind the name of an option."""
    for i, word in enumerate(words):
        if word != "=" or i == 0 or not words[i - 1].startswith("--"):
            yield word
