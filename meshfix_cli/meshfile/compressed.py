"""Files that gzip has compressed, of any format: what is in them is a file like any other.

Source: RFC 1952, "GZIP file format specification version 4.3".
"""

from __future__ import annotations

from pathlib import Path

from meshfix_cli.errors import ReadError

MAGIC = b"\x1f\x8b"
SUFFIX = ".gz"
LEVEL = 6  # of gzip itself
CHUNK = 1 << 14  # bytes; small, as those behind the end of a member are copied

# What is unpacked is at most so many times as large, or so many bytes where that is more: meshes become 2 to 20 times
# as large, and the most that a file can become, which is 1,032 times, is of one byte repeated.
RATIO, FLOOR = 200, 1 << 26


def is_compressed(data: bytes) -> bool:
    """Whether a file begins as those of gzip do."""
    return data.startswith(MAGIC)


def has_suffix(name: Path) -> bool:
    """Whether a name is that of a compressed file."""
    return name.suffix.lower() == SUFFIX


def inner(name: Path) -> Path:
    """Return the name of what is in a compressed file; that of another as it is."""
    return name.with_suffix("") if has_suffix(name) else name


def unpacked(data: bytes) -> bytes:
    """Return what is in a compressed file, of which the members are joined.

    Raises
    ------
    ReadError
        It is damaged, or far larger than a mesh would be.
    """
    import zlib

    parts: list[bytes] = []
    most = max(FLOOR, RATIO * len(data))
    at, left = 0, most
    view = memoryview(data)
    while data.startswith(MAGIC, at):
        member = zlib.decompressobj(wbits=31)
        while not member.eof:
            chunk = view[at : at + CHUNK]
            if not chunk:
                raise ReadError("is truncated: what gzip has compressed does not end")
            try:
                parts.append(member.decompress(chunk, left + 1))
            except zlib.error as error:
                raise ReadError("is not a readable .gz file: it is damaged") from error
            at += len(chunk) - len(member.unused_data)
            left -= len(parts[-1])
            if left < 0:
                raise ReadError(f"would be more than {most:,} bytes when it is unpacked, which no mesh of its size is")
    if data[at:].strip(b"\0"):  # zeros fill a block of a tape
        raise ReadError("is not a readable .gz file: behind its end is something else")
    content = b"".join(parts)
    if is_compressed(content):
        raise ReadError("is compressed twice; unpack it once")
    return content


def packed(data: bytes) -> bytes:
    """Compress a file: the same bytes for the same content, with no name and no time in them."""
    import zlib

    packer = zlib.compressobj(LEVEL, wbits=31)
    return packer.compress(data) + packer.flush()
