"""What other libraries say of an error, in words that the user of a file knows: none of Python, meshio or HDF5."""

from __future__ import annotations

import errno
import re
import struct
from xml.etree.ElementTree import ParseError

from meshfix_cli.errors import on_one_line

MOST = 200  # letters of a sentence, of which a file may hold a part
TOO_EARLY = "it ends too early, or a line of it does"
_NUMBER = r"(?:could not convert string(?: to float)?|invalid literal for int\(\) with base 10):? (?:np\.\w+\()?b?['\"]"
_SHORT = r"cannot reshape|buffer (?:is|size)|string or file could not be read|number of columns changed"
_OTHER = r"too many values to unpack|could not be broadcast|setting an array element with a sequence|inhomogeneous"
# What is said, and what that means.
_SAID = (
    (rf"{_NUMBER}\s*['\"]", TOO_EARLY),
    (rf"{_NUMBER}(.+?)['\"]", "{0!r} stands where a number should"),
    (r"Some errors were detected|columns \(got", "its lines have different numbers of words"),
    (_SHORT, "it holds fewer or other numbers than it announces"),
    (r"object '([^']*)' doesn't exist", "it has no {0}"),
    (r"not enough values to unpack|out of (?:range|bounds)|Premature EOF", TOO_EARLY),
    (_OTHER, "a line of it has other words than it should"),
    (r"BEGIN BULK", "it has no BEGIN BULK"),
    (r"first line to be `?OFF", "it does not begin with OFF on a line of its own"),
)
_OF_CODE = re.compile(r"[`{}\[\]]|\w\(|np\.|\b[Ee]rror\b|https?:|__|\bNone\b")


def plainly(error: BaseException, printed: str = "", otherwise: str = "") -> str:
    """Say in a sentence what is wrong with a file that a library raised an error about, or printed one and left.

    Parameters
    ----------
    error : exception
    printed : str
        What the library wrote to the terminal.
    otherwise : str
        The sentence about what could not be written, where what it says is about reading or for programmers.
    """
    if isinstance(error, ImportError):
        return f"that needs the package {error.name}"
    said = on_one_line(re.sub(r"Error:\s+Couldn't\s+read\s+file.*", "", printed, flags=re.DOTALL) or error)
    if otherwise:
        return said[:MOST].rstrip(".") if _is_for_people(error, said) else otherwise
    for pattern, words in _SAID:
        if found := re.search(pattern, said):
            return words.format(*found.groups())[:MOST]
    if isinstance(error, OSError):
        return (
            "a file that it names is missing"
            if error.errno == errno.ENOENT
            else "its content is damaged, or of another format"
        )
    if isinstance(error, ParseError):
        return "its XML breaks off or is wrong at line {}, column {}".format(*error.position)
    if isinstance(error, UnicodeError):
        return "it is not a text"
    if isinstance(error, (StopIteration, EOFError, struct.error, IndexError)):
        return TOO_EARLY
    if isinstance(error, KeyError) and len(error.args) == 1 and re.fullmatch(r"[\w .:-]+", str(error.args[0])):
        return f"{str(error.args[0])!r} in it is not known"
    return said[:MOST].rstrip(".") if _is_for_people(error, said) else "it is not laid out as it should be"


def _is_for_people(error: BaseException, said: str) -> bool:
    """Whether what an error says was written for the user of a file: what meshio raises, or prints before it leaves."""
    theirs = isinstance(error, SystemExit) or type(error).__module__.startswith("meshio.")
    return theirs and bool(said) and not _OF_CODE.search(said)
