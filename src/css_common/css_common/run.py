# SPDX-License-Identifier: Apache-2.0
"""`main` of every node file. rclpy is loaded only when a node really runs: studies read node files without it."""

import sys
from collections.abc import Callable

from css_common.component import Component
from css_common.mission import find_component


def node_main(component_type: type[Component]) -> Callable[[], int]:
    """What a node file calls its `main`."""

    def main(args: list[str] | None = None) -> int:
        from css_common import node_process

        module = component_type.__module__
        if module == "__main__":  # python -m PACKAGE.nodes.NAME: the imported class is the one that missions refer to
            spec = sys.modules["__main__"].__spec__
            assert spec is not None
            module = spec.name
        package, _, executable = module.partition(".nodes.")
        return node_process.main(find_component(package, executable), sys.argv[1:] if args is None else args)

    return main
