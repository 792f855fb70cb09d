# SPDX-License-Identifier: Apache-2.0
"""A console in a process of its own, as `./sunpoint console` starts it; `WITHOUT` says why there can be none."""

import contextlib
import os
import re
import signal
import subprocess
from collections.abc import Iterator
from typing import NamedTuple

from css_bringup.processes import executable_path
from css_console.errors import ConsoleError
from css_console.provision import provide

try:
    provide(print)  # once: a test is not to wait for it
    WITHOUT = ""
except ConsoleError as why:  # neither here nor to be had
    WITHOUT = str(why)


class Running(NamedTuple):
    """A console that serves."""

    process: subprocess.Popen
    address: str


@contextlib.contextmanager
def console(*arguments: str) -> Iterator[Running]:
    """Starts it on a free port, waits for its address, and interrupts it in the end."""
    command = [executable_path("css_console", "console"), *arguments, "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"})
    try:
        assert process.stdout is not None
        said = []
        for line in process.stdout:
            said.append(line)
            if found := re.search(r"console: (http://\S+)", line):
                yield Running(process, found[1])
                break
        else:
            raise AssertionError(f"no address: {''.join(said)}")
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=60.0)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
