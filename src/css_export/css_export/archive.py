# SPDX-License-Identifier: Apache-2.0
"""Static archives as linkers read them (the format of System V, with its table of symbols), the same on every run."""

import struct
from collections.abc import Mapping

from css_export.elf import contents


def archive(objects: Mapping[str, bytes]) -> bytes:
    """An archive of object files by their names, of at most 15 characters each."""
    symbols = [(name, symbol) for name, data in objects.items() for symbol in contents(data).offered]
    texts = b"".join(symbol.encode() + b"\0" for _, symbol in symbols)
    table_size = 4 + 4 * len(symbols) + len(texts)
    places, at = {}, 8 + 60 + table_size + table_size % 2
    for name, data in objects.items():
        places[name] = at
        at += 60 + len(data) + len(data) % 2
    offsets = [places[name] for name, _ in symbols]
    table = struct.pack(f">I{len(offsets)}I", len(offsets), *offsets) + texts
    return b"!<arch>\n" + _member("/", table) + b"".join(_member(f"{name}/", data) for name, data in objects.items())


def _member(name: str, data: bytes) -> bytes:
    if len(name) > 16:
        raise ValueError(f"{name}: at most 15 characters fit in an archive")
    head = f"{name:<16}{0:<12}{0:<6}{0:<6}{'644':<8}{len(data):<10}`\n"
    return head.encode() + data + b"\n" * (len(data) % 2)
