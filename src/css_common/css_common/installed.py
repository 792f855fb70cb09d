# SPDX-License-Identifier: Apache-2.0
"""Where an installed package keeps its files, read from the ament index as ROS reads it (REP 122), without ROS."""

import os
from pathlib import Path

INDEX = "AMENT_PREFIX_PATH"
_MARKS = "share/ament_index/resource_index/packages"


def share_folder(package: str) -> Path:
    """The folder `share/PACKAGE` of the first installation that has the package.

    Raises:
        LookupError: the package is not installed.
    """
    for prefix in filter(None, os.environ.get(INDEX, "").split(os.pathsep)):
        # a name with a slash or a dot in front is no package, whatever file it would lead to
        if package.isidentifier() and Path(prefix, _MARKS, package).is_file():
            return Path(prefix, "share", package)
    raise LookupError(f"package {package} is not installed (searched {INDEX})")
