# SPDX-License-Identifier: Apache-2.0
"""What kernels hand to Python: the classes they name, no reference too many, and Ctrl-C at any moment."""

import gc
import subprocess
import sys
from typing import NamedTuple

from css_common.kernel import kernel


class Pair(NamedTuple):
    """Members of one type, which numba treats apart."""

    x: float
    y: float


class Nested(NamedTuple):
    """Members of several."""

    pair: Pair
    steps: int
    ends: tuple[Pair, bool]


@kernel
def nested(p: Pair, count: int) -> Nested:
    turned = Pair(p.y, -p.x)
    return Nested(turned, count + 1, (p, count > 2))


def test_the_classes_are_those_that_the_kernel_names():
    made = nested(Pair(1.0, 2.0), 2)
    assert made == Nested(Pair(2.0, -1.0), 3, (Pair(1.0, 2.0), False))
    assert [type(part) for part in (made, made.pair, made.ends, made.ends[0])] == [Nested, Pair, tuple, Pair]
    assert made._replace(steps=0).steps == 0 and nested(made.pair, 3).ends[1] is True


def test_no_reference_is_left():
    for _ in range(2):
        made = [nested(Pair(1.0, 2.0), i) for i in range(1000)]
        del made
        gc.collect()
    before = sys.getrefcount(Nested), sys.getrefcount(Pair)
    made = [nested(Pair(1.0, 2.0), i) for i in range(1000)]
    assert sys.getrefcount(Nested) == before[0] + 1000
    del made
    gc.collect()
    assert (sys.getrefcount(Nested), sys.getrefcount(Pair)) == before


_INTERRUPTED = """
import os, signal, threading, time
from css_common.kernel import typed_call
from test_boxed_tuples import Nested, Pair, nested

call = typed_call(nested)
p, count = Pair(1.0, 2.0), 0
call(p, count)
went_on = True

def interrupt():
    while went_on:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.0002)

other = threading.Thread(target=interrupt)
came = 0
while came < 1000:
    try:
        if not came and not other.is_alive():
            other.start()
        while True:
            made = call(p, count)
            assert type(made) is Nested and type(made.ends[0]) is Pair
            count = made.steps
    except KeyboardInterrupt:
        came += 1
signal.signal(signal.SIGINT, signal.SIG_IGN)
went_on = False
other.join()
"""


def test_an_interrupt_comes_between_calls_and_never_within_one():
    done = subprocess.run([sys.executable, "-c", _INTERRUPTED], cwd=__file__.rpartition("/")[0], check=False)
    assert done.returncode == 0
