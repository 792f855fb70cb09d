# SPDX-License-Identifier: Apache-2.0
"""What a replay is asked for: an estimator, under what name, with which parameters changed."""

from collections.abc import Mapping
from dataclasses import dataclass

from css_common.mission_file import MissionError

_GYRO = {"on": "true", "off": "false"}


@dataclass(frozen=True)
class EstimatorRequest:
    """An estimator to replay: which, under what name, with which parameters changed."""

    label: str
    kind: str
    changes: Mapping[str, str]


def parse_request(text: str) -> EstimatorRequest:
    """A request from `NAME[:KEY=VALUE[,KEY=VALUE]...]`; `gyro=on|off` is short for `use_gyro`.

    Raises:
        MissionError: the text has another form.
    """
    kind, _, rest = text.partition(":")
    changes: dict[str, str] = {}
    label = [kind]
    for item in filter(None, rest.split(",")):
        key, separator, value = item.partition("=")
        if not separator:
            raise MissionError(f"estimator {text!r}: {item!r} given, expected KEY=VALUE")
        if key == "gyro":
            if value not in _GYRO:
                raise MissionError(f"estimator {text!r}: gyro={value} given, expected on or off")
            changes["use_gyro"] = _GYRO[value]
        else:
            changes[key] = value
        label.append("".join(c if c.isalnum() else "_" for c in f"{key}_{value}"))
    if not kind.isidentifier():
        raise MissionError(f"estimator {text!r} given, expected NAME[:KEY=VALUE,...]")
    return EstimatorRequest("_".join(label), kind, changes)
