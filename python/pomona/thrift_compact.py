"""The compact protocol of Thrift, as far as the footer of a Parquet file needs it; to write only.

Source: thrift/doc/specs/thrift-compact-protocol.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

__all__ = ["ThriftValue", "i32", "i64", "listed", "structure", "text", "varint"]

_I32, _I64, _BINARY, _LIST, _STRUCT = 5, 6, 8, 9, 12

_MOST_SHORT = 14
"""Elements that the head of a list counts in half a byte."""


@dataclass(frozen=True)
class ThriftValue:
    """A value: the number of its type, and its bytes."""

    kind: int
    encoded: bytes


def varint(number: int) -> bytes:
    """Encode a number from 0 in sevens of bits, the lowest first."""
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


def i32(number: int) -> ThriftValue:
    """Give a whole number of 32 bits."""
    return ThriftValue(_I32, _zigzag(number))


def i64(number: int) -> ThriftValue:
    """Give a whole number of 64 bits."""
    return ThriftValue(_I64, _zigzag(number))


def text(content: str) -> ThriftValue:
    """Give a text in UTF-8."""
    encoded = content.encode()
    return ThriftValue(_BINARY, varint(len(encoded)) + encoded)


def listed(values: Sequence[ThriftValue]) -> ThriftValue:
    """Give a list of values of one type; of an empty one the type is that of structures."""
    kind = values[0].kind if values else _STRUCT
    n = len(values)
    head = bytes([n << 4 | kind]) if n <= _MOST_SHORT else bytes([0xF0 | kind]) + varint(n)
    return ThriftValue(_LIST, head + b"".join(value.encoded for value in values))


def structure(fields: Mapping[int, ThriftValue]) -> ThriftValue:
    """Give a structure of fields by their numbers, ascending, each at most 15 after the one before."""
    encoded, before = b"", 0
    for number, value in fields.items():
        encoded += bytes([(number - before) << 4 | value.kind]) + value.encoded
        before = number
    return ThriftValue(_STRUCT, encoded + b"\0")


def _zigzag(number: int) -> bytes:
    return varint(number << 1 if number >= 0 else (-number << 1) - 1)
