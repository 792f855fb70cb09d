# SPDX-License-Identifier: Apache-2.0
"""Which Sun estimators there are."""

from importlib import resources

from css_common.component import Component
from css_common.node_files import find_component
from css_estimation.sun.sun_estimator import SunEstimator

_PACKAGE = "css_estimation"


def estimators() -> dict[str, type[SunEstimator]]:
    """All Sun estimators by the name of their node file, found by listing."""
    files = sorted(file.name for file in (resources.files(_PACKAGE) / "nodes").iterdir())
    names = [name.removesuffix(".py") for name in files if name.endswith(".py") and not name.startswith("_")]
    found: dict[str, type[Component]] = {name: find_component(_PACKAGE, name) for name in names}
    return {name: kind for name, kind in found.items() if issubclass(kind, SunEstimator)}
