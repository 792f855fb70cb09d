# SPDX-License-Identifier: Apache-2.0
"""Who may speak on a topic: one writer until it is gone, and then the right one."""

import os
import subprocess
import sys

import pytest

from css_common.writers import Writer, WriterChoice, local_processes

OURS, OTHER = "/css_array", "/stranger"


def gid(number: int, process: int = 0x1234) -> bytes:
    """A GID as Fast DDS makes them."""
    return b"\x01\x0f\x78\xfd" + process.to_bytes(2, "little") + bytes(9) + bytes([number])


def choice(**options) -> WriterChoice:
    """A choice that prefers the node of the graph."""
    return WriterChoice(OURS, **options)


def running(*processes: int):
    """What `local_processes` gives where these run."""
    return lambda: frozenset(processes)


ALIVE = running(0x1234)


def test_first_writer_is_heard_and_a_second_one_is_a_stranger():
    heard = choice()
    first, second = Writer(gid(1), "/driver"), Writer(gid(2), OTHER)
    assert not heard.update([first], ALIVE)
    assert (heard.accepted, heard.strangers) == (first, ())
    for order in ([first, second], [second, first]):
        assert not heard.update(order, ALIVE)
        assert (heard.accepted, heard.strangers) == (first, (second,))


def test_of_several_at_once_the_one_of_the_graph_is_heard():
    heard = choice()
    ours, other = Writer(gid(2), OURS), Writer(gid(1), OTHER)
    heard.update([other, ours], ALIVE)
    assert (heard.accepted, heard.strangers) == (ours, (other,))


def test_only_the_node_of_the_graph_is_heard_where_the_graph_decides():
    heard = choice(only=True)
    ours, other = Writer(gid(2), OURS), Writer(gid(1), OTHER)
    heard.update([other], ALIVE)
    assert (heard.accepted, heard.strangers) == (None, (other,))
    heard.update([other, ours], ALIVE)
    assert (heard.accepted, heard.strangers) == (ours, (other,))
    assert not heard.update([other], ALIVE)
    assert heard.accepted is None, "its writer is gone, and nobody inherits"


def test_writer_takes_over_when_the_one_before_is_gone():
    heard = choice()
    first, second = Writer(gid(1), "/driver"), Writer(gid(2), "/driver")
    heard.update([first], ALIVE)
    assert not heard.update([], ALIVE)
    assert heard.update([second], ALIVE)
    assert (heard.accepted, heard.strangers) == (second, ())
    assert not heard.update([second], ALIVE), "once"


def test_restarted_node_takes_over_from_its_dead_process_and_not_from_a_living_one():
    heard = choice(only=True)
    old, new = Writer(gid(1, 100), OURS), Writer(gid(1, 200), OURS)
    heard.update([old], running(100))
    heard.update([old, new], running(100, 200))
    assert (heard.accepted, heard.strangers) == (old, (new,)), "two flights with the same names"
    assert heard.update([old, new], running(200))
    assert (heard.accepted, heard.strangers) == (new, ())


def test_process_that_was_never_seen_here_may_run_elsewhere():
    heard = choice()
    far, near = Writer(gid(1, 100), "/driver"), Writer(gid(2, 200), "/driver")
    heard.update([far], running())
    heard.update([far, near], running(200))
    assert (heard.accepted, heard.strangers) == (far, (near,))


def test_heir_is_of_the_same_node_if_there_is_one():
    heard = WriterChoice()
    first, other, again = Writer(gid(1), "/a"), Writer(gid(2), "/b"), Writer(gid(3), "/a")
    heard.update([first], ALIVE)
    assert heard.update([other, again], ALIVE)
    assert heard.accepted == again


@pytest.mark.parametrize("only", [True, False])
def test_choice_waits_for_the_names_of_nodes(only):
    heard = choice(only=only)
    heard.update([Writer(gid(1), ""), Writer(gid(2), OTHER)], ALIVE)
    assert heard.undecided
    heard.update([Writer(gid(1), OURS), Writer(gid(2), OTHER)], ALIVE)
    assert not heard.undecided
    assert heard.accepted == Writer(gid(1), OURS)


def test_single_nameless_writer_is_heard_where_anybody_may_be():
    heard = choice()
    heard.update([Writer(gid(1), "")], ALIVE)
    assert heard.accepted == Writer(gid(1), "")
    heard.update([Writer(gid(1), OURS)], ALIVE)
    assert heard.accepted == Writer(gid(1), OURS), "its name is learnt"


def test_processes_run_until_they_have_ended():
    assert os.getpid() & 0xFFFF in local_processes()
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert child.pid & 0xFFFF in local_processes()
    child.kill()
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    assert child.pid & 0xFFFF not in local_processes(), "a process that nobody has reaped yet runs no more"
    child.communicate()
