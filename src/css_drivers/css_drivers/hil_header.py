# SPDX-License-Identifier: Apache-2.0
"""The frames as a header for C and as tables for people, of the one description in `hil_frame`.

python -m css_drivers.hil_header > hil_frame.h
"""

import struct
from collections.abc import Iterator

from css_drivers.hil_frame import (
    COMMAND,
    HAS_FIELD,
    HAS_GYRO,
    HAS_SUN,
    HAS_WHEELS,
    HEADER,
    HEADER_BYTES,
    KIND_COMMAND,
    KIND_SENSORS,
    LONGEST,
    MOST_UNITS,
    SENSORS,
    SYNC,
    VERSION,
    Field,
)

_C_TYPES = {"B": "uint8_t", "H": "uint16_t", "I": "uint32_t", "Q": "uint64_t", "f": "float"}
_PARTS = (("HEADER", HEADER, len(SYNC)), ("SENSORS", SENSORS, 0), ("COMMAND", COMMAND, 0))


def c_header() -> str:
    """Text of the header: constants, and the place of each field."""
    constants = {
        "SYNC0": f"0x{SYNC[0]:02X}u",
        "SYNC1": f"0x{SYNC[1]:02X}u",
        "VERSION": f"{VERSION}u",
        "KIND_SENSORS": f"{KIND_SENSORS}u",
        "KIND_COMMAND": f"{KIND_COMMAND}u",
        "HEADER_BYTES": f"{HEADER_BYTES}u",
        "LONGEST_PAYLOAD": f"{LONGEST}u",
        "MOST_UNITS": f"{MOST_UNITS}u",
        "HAS_GYRO": f"{HAS_GYRO}u",
        "HAS_FIELD": f"{HAS_FIELD}u",
        "HAS_WHEELS": f"{HAS_WHEELS}u",
        "HAS_SUN": f"{HAS_SUN}u",
    }
    lines = [
        "/* SPDX-License-Identifier: Apache-2.0",
        " * Frames between the simulation and a board; made by: python -m css_drivers.hil_header",
        " * Little endian. HIL_X_Y_AT is the place of field Y in part X, in bytes; that of the header counts from the",
        " * sync, those of sensors and command from the begin of their payload. A CRC-32 follows the payload. */",
        "#ifndef HIL_FRAME_H",
        "#define HIL_FRAME_H",
        "",
        *(f"#define HIL_{name} {value}" for name, value in constants.items()),
    ]
    for part, fields, begin in _PARTS:
        lines += ["", *_macros(part, fields, begin)]
    return "\n".join([*lines, "", "#endif", ""])


def _macros(part: str, fields: tuple[Field, ...], begin: int) -> Iterator[str]:
    at, counted = begin, ""
    names: list[str] = []
    for field in (*fields, None):
        name = "BYTES" if field is None else f"{field.name.upper()}_AT"
        arguments = f"({', '.join(names)})" if names else ""
        value = f"({at}u{counted})" if counted else f"{at}u"
        comment = "" if field is None else f" /* {_C_TYPES[field.code]}{_count(field)} {field.unit} */"
        if field is None and part == "HEADER":
            return
        yield f"#define HIL_{part}_{name}{arguments} {value}{comment}"
        if field is None:
            return
        size = struct.calcsize("<" + field.code)
        if isinstance(field.elements, int):
            at += size * field.elements
        else:
            names.append(field.elements)
            counted += f" + {size}u * ({field.elements})"


def _count(field: Field) -> str:
    return "" if field.elements == 1 else f"[{field.elements}]"


def tables() -> str:
    """The frames as tables in Markdown."""
    text = []
    for part, fields, _ in _PARTS:
        rows = (f"| `{f.name}` | `{_C_TYPES[f.code]}{_count(f)}` | {f.unit} | {f.meaning} |" for f in fields)
        text.append(
            f"**{part.capitalize()}**\n\n| field | type | unit | meaning |\n|---|---|---|---|\n" + "\n".join(rows)
        )
    return "\n\n".join(text) + "\n"


if __name__ == "__main__":
    print(c_header(), end="")
