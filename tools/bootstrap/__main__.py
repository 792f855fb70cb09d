# SPDX-License-Identifier: Apache-2.0
"""Entry of `./sunpoint`, run as a folder: `python -I -S tools/bootstrap VERB ...`."""

import os
import sys

sys.path[0] = os.path.dirname(sys.path[0])

from bootstrap.cli import main  # noqa: E402  the line above makes it importable

sys.exit(main(sys.argv[1:]))
