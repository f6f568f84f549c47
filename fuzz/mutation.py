"""Damaged copies of files: bytes flipped, cut, repeated and spliced, and what stands for numbers made absurd."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable, Sequence

__all__ = ["mutated"]

MOST_BYTES = 1 << 20
"""Of a case: what is wrong with a large file is wrong with a small one."""

NUMBERS = (
    *(b"0", b"-1", b"1", b"-0.0", b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e400", b"1e-320", b"0.5", b"1e30"),
    *(b"2147483648", b"4294967296", b"9223372036854775808", b"100000000000000", b"99999999999999999999", b"9" * 5000),
    *(b"", b"x", b"1_000", b"0x10", b"\xd9\xa3", b"1e", b"null", b"true", b'"7"', b"[1]", b"{}"),
)
TOKENS = (
    *(
        b"\0",
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\r",
        b"\r\n",
        b"\n\n",
        b"\t",
        b'"',
        b"'",
        b",",
        b";",
        b"#",
        b"%",
        b":",
        b"\\",
    ),
    *(b"../../etc/passwd", b"/dev/zero", b"..", b"\xe2\x80\xa8", b"\x1b[2J", b"NaN", b"Infinity", b"-", b"&a", b"*a"),
    *(b"[" * 100_000, b"{" * 1_000, b'{"a":' * 20_000, b"(" * 300, b"-" * 100_000, b"a" * 1_000_000, b"," * 100_000),
    *(b" " * 100_000, b" #" * 50_000, b'"' * 1_001, b"[[[[", b"- - - - -"),
)
INTEGERS = (0, 1, 2**7, 2**15 - 1, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**63, 2**64 - 1)

Change = Callable[[random.Random, bytes, Sequence[bytes]], bytes]


def mutated(draw: random.Random, seeds: Sequence[bytes]) -> bytes:
    """Damage one of some files in one to four places; the same draws give the same bytes."""
    content = draw.choice(seeds)
    for _ in range(draw.choice((1, 1, 2, 4))):
        content = draw.choice(_CHANGES)(draw, content, seeds)[:MOST_BYTES]
    return content


def _span(draw: random.Random, content: bytes) -> tuple[int, int]:
    start = draw.randint(0, len(content))
    return start, min(len(content), start + int(2 ** draw.uniform(0, 10)))


def _flip(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    damaged = bytearray(content)
    for _ in range(draw.choice((1, 2, 8))):
        if damaged:
            damaged[draw.randrange(len(damaged))] ^= 1 << draw.randrange(8)
    return bytes(damaged)


def _cut_out(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    start, end = _span(draw, content)
    return content[:start] + content[end:]


def _cut_off(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    return content[: draw.randint(0, len(content))]


def _repeat(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    start, end = _span(draw, content)
    return content[:end] + content[start:end] * draw.choice((1, 3, 100)) + content[end:]


def _splice(draw: random.Random, content: bytes, seeds: Sequence[bytes]) -> bytes:
    start, end = _span(draw, other := draw.choice(seeds))
    at, until = _span(draw, content)
    return content[:at] + other[start:end] + content[draw.choice((at, until)) :]


def _overwrite(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    """Put an integer of a header over what is there."""
    number, form = draw.choice(INTEGERS), draw.choice(("<B", "<H", ">H", "<I", ">I", "<Q", ">Q"))
    packed = struct.pack(form, number & (1 << 8 * struct.calcsize(form)) - 1)
    at = draw.randint(0, len(content))
    return content[:at] + packed + content[at + len(packed) :]


def _number(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    """Put something absurd in place of a decimal number."""
    found = list(re.finditer(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?", content[:100_000]))
    if not found:
        return content
    match = draw.choice(found)
    return content[: match.start()] + draw.choice(NUMBERS) + content[match.end() :]


def _insert(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    at = draw.randint(0, len(content))
    return content[:at] + draw.choice(TOKENS) + content[at:]


def _line(draw: random.Random, content: bytes, _: Sequence[bytes]) -> bytes:
    """Move a line to another place, or leave it out."""
    lines = content.split(b"\n")
    line = lines.pop(draw.randrange(len(lines)))
    if draw.random() < 0.6:
        lines.insert(draw.randint(0, len(lines)), line)
    return b"\n".join(lines)


_CHANGES: tuple[Change, ...] = (
    *(_flip, _cut_out, _cut_off, _repeat, _splice, _overwrite, _overwrite, _number, _number, _insert, _line),
)
