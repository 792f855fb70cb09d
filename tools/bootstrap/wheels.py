# SPDX-License-Identifier: Apache-2.0
"""Mends the CMake files of the ROS wheels, which carry paths of the machine that built them."""

from __future__ import annotations

import os
import re
from pathlib import Path

_BUILDER = r"/opt/python/cp3\d+-cp3\d+"
_NUMPY = re.compile(_BUILDER + r"/lib/python3\.\d+/site-packages/numpy/_?core/include")
_PYTHON = re.compile(_BUILDER + r"/include/python3\.\d+")


def mend_cmake_files(share: Path, python_include: str, numpy_include: str) -> int:
    """Put this machine's include folders into every exported CMake file below `share`; how many changed.

    A file is replaced, not rewritten in place: installers hard-link packages from their cache, and the
    cached copy must stay as it was published.
    """
    mended = 0
    for file in sorted(share.glob("*/cmake/*.cmake")):
        text = file.read_text()
        new = _PYTHON.sub(lambda _: python_include, _NUMPY.sub(lambda _: numpy_include, text))
        if new != text:
            draft = file.with_name(file.name + ".mended")
            draft.write_text(new)
            os.replace(draft, file)
            mended += 1
    return mended
