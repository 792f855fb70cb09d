# SPDX-License-Identifier: Apache-2.0
"""Numbers that compiled functions and messages share, by their names."""

from types import ModuleType


def shared_numbers(module: ModuleType, message: type) -> tuple[dict[str, int], dict[str, int]]:
    """Constants of a message type that a module has too, with or without a leading underscore: its own, the type's."""
    own = {name.lstrip("_"): value for name, value in vars(module).items()}
    names = [name for name in dir(type(message)) if name.isupper() and name in own]
    return {name: own[name] for name in names}, {name: getattr(message, name) for name in names}
