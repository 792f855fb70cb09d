# SPDX-License-Identifier: Apache-2.0
"""What stands in an object file: sizes of its sections and its symbols (System V ABI, ELF)."""

import struct
from typing import NamedTuple

_SHT_SYMTAB, _SHT_NOBITS = 2, 8
_SHF_WRITE, _SHF_ALLOC, _SHF_EXECINSTR = 1, 2, 4
_STT_FUNC, _UNDEFINED = 2, 0


class Symbol(NamedTuple):
    """A name in an object; `defined`: it stands there, else it has to be linked."""

    name: str
    defined: bool
    is_global: bool
    is_function: bool
    size: int  # [bytes]


class Contents(NamedTuple):
    """Bytes of code, of data that do not change and of data that do, and the symbols."""

    code: int
    constants: int
    variables: int
    symbols: tuple[Symbol, ...]

    @property
    def missing(self) -> list[str]:
        """Names that have to be linked."""
        return sorted({s.name for s in self.symbols if s.is_global and not s.defined and s.name})

    @property
    def offered(self) -> list[str]:
        """Names that others can link."""
        return [s.name for s in self.symbols if s.is_global and s.defined]


class _Section(NamedTuple):
    name: str
    kind: int
    flags: int
    offset: int
    size: int
    link: int


def contents(data: bytes) -> Contents:
    """What an object holds.

    Raises:
        ValueError: it is no ELF file.
    """
    if data[:4] != b"\x7fELF":
        raise ValueError("no ELF file")
    wide, order = data[4] == 2, "<" if data[5] == 1 else ">"
    sections = _sections(data, wide, order)
    sizes = [0, 0, 0]
    for section in sections:
        if not section.flags & _SHF_ALLOC or section.name.startswith((".eh_frame", ".ARM.ex", ".llvm")):
            continue
        place = 0 if section.flags & _SHF_EXECINSTR else 2 if section.flags & _SHF_WRITE else 1
        # relocated constants are constants
        if section.name.startswith(".data.rel.ro"):
            place = 1
        sizes[place] += section.size
    code, constants, variables = sizes
    return Contents(code, constants, variables, tuple(_symbols(data, sections, wide, order)))


def _sections(data: bytes, wide: bool, order: str) -> list[_Section]:
    head = struct.unpack_from(order + ("16xHHIQQQIHHHHHH" if wide else "16xHHIIIIIHHHHHH"), data)
    start, entry, count, names = head[5], head[10], head[11], head[12]
    kind = order + ("IIQQQQIIQQ" if wide else "IIIIIIIIII")
    rows = [struct.unpack_from(kind, data, start + i * entry) for i in range(count)]
    texts = rows[names][4]
    return [_Section(_text(data, texts + row[0]), row[1], row[2], row[4], row[5], row[6]) for row in rows]


def _symbols(data: bytes, sections: list[_Section], wide: bool, order: str) -> list[Symbol]:
    found = []
    for table in sections:
        if table.kind != _SHT_SYMTAB:
            continue
        texts = sections[table.link].offset
        size = 24 if wide else 16
        for at in range(table.offset + size, table.offset + table.size, size):
            if wide:
                name, info, _, section, _, length = struct.unpack_from(order + "IBBHQQ", data, at)
            else:
                name, _, length, info, _, section = struct.unpack_from(order + "IIIBBH", data, at)
            text = _text(data, texts + name)
            found.append(Symbol(text, section != _UNDEFINED, info >> 4 != 0, info & 15 == _STT_FUNC, length))
    return found


def _text(data: bytes, at: int) -> str:
    return data[at : data.index(0, at)].decode()
