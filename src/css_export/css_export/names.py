# SPDX-License-Identifier: Apache-2.0
"""What things are called in C."""

import re

_KEYWORDS = frozenset(
    [
        "alignas",
        "alignof",
        "and",
        "and_eq",
        "asm",
        "auto",
        "bitand",
        "bitor",
        "bool",
        "break",
        "case",
        "catch",
        "char",
        "class",
        "compl",
        "const",
        "constexpr",
        "continue",
        "decltype",
        "default",
        "delete",
        "do",
        "double",
        "else",
        "enum",
        "explicit",
        "export",
        "extern",
        "false",
        "float",
        "for",
        "friend",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "mutable",
        "namespace",
        "new",
        "noexcept",
        "not",
        "not_eq",
        "nullptr",
        "operator",
        "or",
        "or_eq",
        "private",
        "protected",
        "public",
        "register",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "template",
        "this",
        "throw",
        "true",
        "try",
        "typedef",
        "typeid",
        "typename",
        "union",
        "unsigned",
        "using",
        "virtual",
        "void",
        "volatile",
        "wchar_t",
        "while",
        "xor",
        "xor_eq",
    ]
)


def identifier(name: str) -> str:
    """A name as C and C++ take it."""
    clean = re.sub(r"\W", "_", name)
    if not clean or clean[0].isdigit():
        return f"n{clean}"
    return f"{clean}_" if clean in _KEYWORDS else clean


def prefix_of(library: str) -> str:
    """With what all symbols of a library begin."""
    return f"sunpoint_{identifier(library)}"


def snake(name: str) -> str:
    """`HealthState` as `health_state`."""
    return identifier(re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower())


def quoted(text: str) -> str:
    """A text as C writes it, ASCII alone."""
    plain = text.encode("ascii", "replace").decode().replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'


def comment(text: str) -> str:
    """A text as it may stand in a comment of C."""
    return text.encode("ascii", "replace").decode().replace("*/", "* /").replace("\\", "/").replace("??", "?")


def of_python(symbol: str) -> str:
    """The function of Python that a symbol of numba's is of, by its module; of another symbol that itself."""
    found, rest = [], symbol.removeprefix("_ZN") if symbol.startswith("_ZN") else ""
    while length := re.match(r"\d+", rest):
        end = length.end() + int(length[0])
        found.append(rest[length.end() : end])
        rest = rest[end:]
    return ".".join(found).removeprefix("_3cdynamic_3e.") or symbol
