# SPDX-License-Identifier: Apache-2.0
"""Entry of `./sunpoint`, run as a folder: `python -I -S tools/bootstrap VERB ...`."""

import os
import sys

sys.path[0] = os.path.dirname(sys.path[0])
# modules that need no more than this: see bootstrap.joining
sys.path.append(os.path.join(os.path.dirname(sys.path[0]), "src", "css_common"))

from bootstrap.cli import main  # noqa: E402  the lines above make it importable

sys.exit(main(sys.argv[1:]))
