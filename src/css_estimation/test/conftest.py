# SPDX-License-Identifier: Apache-2.0
"""Lets tests import the helpers that lie beside them (`attitude_scene`, `clark_light`)."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
