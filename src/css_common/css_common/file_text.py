# SPDX-License-Identifier: Apache-2.0
"""The text of a file that people write, and where it is none."""

_MOST_SHOWN = 40  # characters of a line


def decoded(data: bytes) -> str:
    """UTF-8, or UTF-16 with its mark.

    Raises:
        ValueError: it is neither; says in which line, what stands there and what would be right.
    """
    utf_16 = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return data.decode("utf-16" if utf_16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        if utf_16:
            raise ValueError("begins as UTF-16 but is cut or damaged; expected text in UTF-8") from None
        before = data[: error.start]
        line = before.count(b"\n") + 1
        if b"\0" in data:
            raise ValueError(f"line {line}: holds binary data, expected text in UTF-8") from None
        begin = before.rfind(b"\n") + 1
        written = data[begin:].split(b"\n", 1)[0].decode("latin-1").strip()
        shown = written if len(written) <= _MOST_SHOWN else f"{written[:_MOST_SHOWN]}..."
        byte = f"byte 0x{data[error.start]:02X}"
        raise ValueError(
            f"line {line}, {shown!r} if that is Latin-1: {byte} is no UTF-8; expected text saved as UTF-8"
        ) from None
