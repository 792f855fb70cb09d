# SPDX-License-Identifier: Apache-2.0
"""What a plain word in a parameter file means to ROS, read and written.

YAML 1.1 makes an instant of 2013-06-01, 90 of 1:30, nothing of null, a text of 1e-4 and a truth value of the key
`off`. The parser of ROS does not: a word is a truth value, else what `strtol` takes to its end, else what `strtod`
takes to its end without leaving the range of a double, else a text.
"""

import re
import sys
from typing import Any, ClassVar

import yaml

_TRUTHS = {
    form: truth
    for words, truth in ((("y", "yes", "true", "on"), True), (("n", "no", "false", "off"), False))
    for word in words
    for form in (word, word.title(), word.upper())
}
_WHOLE = re.compile(r"[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
_DECIMAL = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_HEX = re.compile(r"[-+]?0[xX]([0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)([pP][-+]?[0-9]+)?")
_NO_NUMBER = re.compile(r"([-+]?)(?:\.(inf|Inf|INF|nan|NaN|NAN)|(?i:(inf|nan|infinity)))")
_MOST_DIGITS = 24  # no whole number of 64 bits has more, in any base


def word(text: str) -> Any:
    """The truth value, whole number, number or text that a plain word stands for; None where there is no word."""
    if not text:
        return None
    if text in _TRUTHS:
        return _TRUTHS[text]
    if _WHOLE.fullmatch(text):
        return _whole(text)
    if _DECIMAL.fullmatch(text) or _HEX.fullmatch(text):
        return _real(text)
    special = _NO_NUMBER.fullmatch(text)
    if special:
        return float(special[1] + (special[2] or special[3]))
    return text


def _whole(text: str) -> int | float | str:
    if len(text) <= _MOST_DIGITS:
        digits = text.lower()
        number = int(digits, 16 if "x" in digits else 8 if digits.lstrip("+-").startswith("0") else 10)
        if -(2**63) <= number < 2**63:
            return number
    return _real(text)


def _real(text: str) -> float | str:
    try:
        number = float.fromhex(text) if "x" in text.lower() else float(text)
    except OverflowError:
        return text
    lost = abs(number) < sys.float_info.min and re.search("[1-9a-fA-F]", re.split("[eEpP]", text)[0].lstrip("+-0xX"))
    return text if lost or abs(number) == float("inf") else number


class Dumper(yaml.SafeDumper):
    """Quotes every text that a parser, that of ROS or one of YAML, would read as something else."""

    _tags: ClassVar[dict[type, str]] = {
        kind: f"tag:yaml.org,2002:{name}" for kind, name in ((bool, "bool"), (int, "int"), (float, "float"))
    }

    def resolve(self, kind: type, value: Any, implicit: Any) -> Any:
        """The tag of a word that stands there without quotes."""
        if kind is yaml.ScalarNode and implicit[0]:
            tag = self._tags.get(type(word(value)))
            if tag is not None:
                return tag
        return super().resolve(kind, value, implicit)

    def ignore_aliases(self, data: Any) -> bool:
        """Never: ROS reads no aliases."""
        return True
