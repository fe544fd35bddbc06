"""Text that terminals, logs and pages can show, whatever names hold. Light to import."""

from __future__ import annotations

import re

# What acts on a terminal or hides what stands beside it: control characters (C0, DEL, C1), marks and overrides of the
# direction of text, and ends of lines; and what Python has in names of files for bytes that are no text, which cannot
# be encoded.
_UNSHOWABLE = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def plain(text: str) -> str:
    r"""Return a text on one line, in which what cannot be shown is escaped: `\x1b`, `\n`, `\u202e`."""
    return _UNSHOWABLE.sub(lambda found: _escaped(found[0]), text)


def _escaped(character: str) -> str:
    byte = ord(character) - 0xDC00
    if 0x80 <= byte <= 0xFF:  # of the name of a file
        return f"\\x{byte:02x}"
    return character.encode("unicode_escape").decode("ascii")
