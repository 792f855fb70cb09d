# SPDX-License-Identifier: Apache-2.0
"""Files that are written whole or not at all, with an error that names them."""

import os
from contextlib import suppress
from pathlib import Path


def write_whole(file: Path, content: str | bytes) -> None:
    """Writes a file, text as UTF-8; on a full disk what was there stays.

    Raises:
        OSError: it cannot be written; says which file.
    """
    temporary = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        temporary.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
        temporary.replace(file)
    except OSError as error:
        # a write that fails knows nothing of the name
        raise OSError(error.errno, error.strerror, str(file)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
