# SPDX-License-Identifier: Apache-2.0
"""What may go wrong with a device, by kind: all that a driver does about it hangs on that."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager

GONE = "gone"
"""The bus or line is not there: it is opened again after a while."""
REFUSED = "refused"
"""The device does not acknowledge: it is off, or answers to another address."""
TIMEOUT = "timeout"
"""It acknowledges and does not come to an end, or says nothing."""
TRASH = "trash"
"""What it says cannot be right: wrong contents of a register, a wrong checksum, no number."""

KINDS = (GONE, REFUSED, TIMEOUT, TRASH)

_REFUSING = frozenset((errno.EREMOTEIO, errno.ENXIO))
_LATE = frozenset((errno.ETIMEDOUT, errno.EAGAIN, errno.EBUSY))


class DeviceError(Exception):
    """A reading that there is not.

    Attributes:
        kind: one of `KINDS`.
    """

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


def reason(error: Exception) -> str:
    """Why, in the system's words where it is the system that refused: libraries wrap them into their own."""
    number = getattr(error, "errno", None)
    return os.strerror(number) if isinstance(number, int) else str(error)


@contextmanager
def of_device(name: str) -> Iterator[None]:
    """Makes what Linux says of a device a `DeviceError` that names it."""
    try:
        yield
    except OSError as error:
        kind = REFUSED if error.errno in _REFUSING else TIMEOUT if error.errno in _LATE else GONE
        raise DeviceError(kind, f"{name}: {reason(error)}") from error
