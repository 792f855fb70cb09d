# SPDX-License-Identifier: Apache-2.0
"""Operations of a step at most: closed forms for loops of known numbers of rounds, and what has no bound is named."""

from typing import NamedTuple

import numpy as np
import pytest

from css_common.kernel import kernel
from css_common.mission import load_mission
from css_export.counted_operations import counted, most_counted, with_counters
from css_export.flown import INPUT, PARAMETERS, Function
from css_export.library import made_library
from css_export.operations import OPERATIONS, Bound, bound_of
from css_export.recorded_calls import Listener
from css_export.targets import TARGETS

HOST = TARGETS["x86_64"]


def loop(rounds: str, body: str = "", compared: str = "slt", name: str = "f", step: int = 1) -> str:
    """A function whose loop has two operations before `body` and goes on while `%i` is less than `rounds`."""
    return f"""
define void @{name}(ptr %p, i64 %n) {{
entry:
  br label %head
head:
  %i = phi i64 [ 0, %entry ], [ %i.next, %back ]
  %more = icmp {compared} i64 %i, {rounds}
  br i1 %more, label %back, label %over
back:
{body}  %i.next = add nsw i64 %i, {step}
  br label %head
over:
  ret void
}}
"""


def test_a_way_without_loops_is_its_longest_branch():
    text = """
define double @f(ptr %p, i1 %c) {
  br i1 %c, label %one, label %other
one:
  %a = load double, ptr %p
  %b = fmul double %a, 2.0
  %d = fadd double %b, 1.0
  br label %over
other:
  br label %over
over:
  %e = phi double [ %d, %one ], [ 0.0, %other ]
  ret double %e
}
"""
    assert bound_of(text, "f") == Bound(1 + 4 + 1)


@pytest.mark.parametrize("rounds", [0, 1, 7, 1000])
def test_a_loop_of_a_known_number_of_rounds(rounds):
    # entry 1; each round 2 at the head and 2 behind it; once more the head; the end 1
    assert bound_of(loop(f"{rounds}"), "f") == Bound(1 + 4 * rounds + 2 + 1)


@pytest.mark.parametrize(
    ("compared", "end", "step", "rounds"),
    [
        ("slt", 10, 3, 4),
        ("sle", 9, 3, 4),
        ("ult", 10, 1, 10),
        ("ule", 10, 1, 11),
        ("ne", 10, 1, 10),
        ("ne", 10, 2, 5),
        ("sgt", -10, -2, 5),
        ("sge", -10, -2, 6),
        ("eq", 0, 1, 1),
    ],
)
def test_every_comparison(compared, end, step, rounds):
    text = loop(f"{end}", compared=compared, step=step)
    assert bound_of(text, "f") == Bound(1 + 4 * rounds + 2 + 1)


def test_loops_in_loops_multiply_and_c_functions_are_counted():
    text = """
declare double @sin(double)
define double @f(ptr %p) {
entry:
  br label %outer
outer:
  %i = phi i64 [ 0, %entry ], [ %i.next, %outer.back ]
  br label %inner
inner:
  %j = phi i64 [ 0, %outer ], [ %j.next, %inner ]
  %y = call double @sin(double 1.0)
  %j.next = add nuw nsw i64 %j, 1
  %inside = icmp eq i64 %j.next, 5
  br i1 %inside, label %outer.back, label %inner
outer.back:
  %i.next = add nuw nsw i64 %i, 1
  %done = icmp eq i64 %i.next, 3
  br i1 %done, label %over, label %outer
over:
  ret double %y
}
"""
    assert bound_of(text, "f") == Bound(1 + 3 * (1 + 5 * 4 + 3) + 1, {"sin": 15})


def test_an_inner_loop_that_hangs_on_the_outer_one_has_its_longest():
    text = """
define void @f(ptr %p) {
entry:
  br label %outer
outer:
  %i = phi i64 [ 0, %entry ], [ %i.next, %outer.back ]
  %some = icmp sgt i64 %i, 0
  br i1 %some, label %inner, label %outer.back
inner:
  %j = phi i64 [ %j.next, %inner ], [ 0, %outer ]
  %j.next = add nuw nsw i64 %j, 1
  %inside = icmp eq i64 %j.next, %i
  br i1 %inside, label %outer.back, label %inner
outer.back:
  %i.next = add nuw nsw i64 %i, 1
  %done = icmp eq i64 %i.next, 6
  br i1 %done, label %over, label %outer
over:
  ret void
}
"""
    # i is 5 at most: 5 rounds of the inner loop are taken for each of 6 of the outer one
    assert bound_of(text, "f") == Bound(1 + 6 * (2 + 5 * 3 + 3) + 1)


def test_a_function_is_bounded_for_each_call_of_it():
    text = (
        loop("%n", name="g")
        + """
define void @f(ptr %p) {
  call void @g(ptr %p, i64 3)
  call void @g(ptr %p, i64 5)
  ret void
}
"""
    )
    assert bound_of(text, "f") == Bound(3 + (1 + 4 * 3 + 3) + (1 + 4 * 5 + 3))


def test_mathematics_that_is_shipped_is_counted_by_name():
    text = (
        loop("%n", name="sunpoint.math.sin")
        + """
define void @f(ptr %p) {
  call void @sunpoint.math.sin(ptr %p, i64 3)
  ret void
}
"""
    )
    assert bound_of(text, "f") == Bound(2, {"sin": 1})
    assert with_counters(text)[1].count("store i64") == 2


def test_whole_numbers_of_the_parameters_have_their_limits():
    text = """
define void @f(ptr %p) {
entry:
  %at = getelementptr inbounds nuw i8, ptr %p, i64 16
  %n = load i64, ptr %at, align 8
  br label %head
head:
  %i = phi i64 [ 0, %entry ], [ %i.next, %back ]
  %more = icmp slt i64 %i, %n
  br i1 %more, label %back, label %over
back:
  %i.next = add nsw i64 %i, 1
  br label %head
over:
  ret void
}
"""
    assert bound_of(text, "f", [(16, 0, 9)]) == Bound(3 + 4 * 9 + 2 + 1)
    around = text.replace("@f(ptr %p)", "@g(i64 %k, ptr %q)").replace("ptr %p", "ptr %q")
    around += "define void @f(ptr %p) {\n  call void @g(i64 1, ptr %p)\n  ret void\n}\n"
    assert bound_of(around, "f", [(16, 0, 9)]) == Bound(2 + 3 + 4 * 9 + 2 + 1)
    assert bound_of(text, "f", [(8, 0, 9)]).operations is None


def test_what_some_rounds_count_is_no_more_than_all_rounds():
    text = """
define void @f(ptr %p, i1 %c) {
entry:
  br label %head
head:
  %i = phi i64 [ 0, %entry ], [ %i.next, %back ]
  %some = phi i64 [ 2, %entry ], [ %more, %back ]
  br i1 %c, label %one, label %back
one:
  %two = add i64 %some, 2
  br label %back
back:
  %either = phi i64 [ %two, %one ], [ %some, %head ]
  %none = add i64 %some, -1
  %more = select i1 %c, i64 %either, i64 %none
  %i.next = add nuw nsw i64 %i, 1
  %end = icmp eq i64 %i.next, 8
  br i1 %end, label %clear, label %head
clear:
  %bytes = shl nuw nsw i64 %some, 3
  call void @llvm.memset.p0.i64(ptr %p, i8 0, i64 %bytes, i1 false)
  ret void
}
"""
    # in 7 rounds back and 1 more it has grown by 2 at most in each of the first
    assert bound_of(text, "f") == Bound(1 + 8 * 8 + 1 + (1 + 2 + 7 * 2) + 1)


def test_a_difference_that_is_compared_with_a_number():
    text = loop("0", body="  %left = sub i64 %i, 12\n").replace("icmp slt i64 %i, 0", "icmp ne i64 %gone, 3")
    text = text.replace("  %more = ", "  %gone = sub i64 %i, %twelve\n  %more = ")
    text = text.replace("entry:\n", "entry:\n  %twelve = and i64 12, -1\n")
    # 15 rounds of 5 with the body, the head of 3 once more, 2 before and 1 after
    assert bound_of(text, "f") == Bound(2 + 15 * 6 + 3 + 1)


@pytest.mark.parametrize(("step", "bounded"), [(2, True), (4, True), (8, False), (3, False)])
def test_a_loop_that_the_compiler_unrolled_has_its_rounds(step, bounded):
    """The number of rounds is one of the lengths of its steps, which the code shows by the bits that it clears."""
    text = f"""
define void @f(ptr %p, i64 %x) {{
entry:
  %some = and i64 %x, 15
  %n = add i64 %some, 16
  %even = and i64 %n, 9223372036854775804
  br label %head
head:
  %i = phi i64 [ 0, %entry ], [ %i.next, %head ]
  %i.next = add i64 %i, {step}
  %end = icmp eq i64 %i.next, %even
  br i1 %end, label %over, label %head
over:
  ret void
}}
"""
    bound = bound_of(text, "f")
    assert bound == Bound(4 + 3 * (28 // step) + 1) if bounded else bound.operations is None


@pytest.mark.parametrize("rounds", [1, 6])
def test_rounds_that_are_counted_up_to_an_overflow(rounds):
    text = f"""
define void @f(ptr %p) {{
entry:
  br label %head
head:
  %i = phi i64 [ -{rounds}, %entry ], [ %i.next, %back ]
  %both = tail call {{ i64, i1 }} @llvm.uadd.with.overflow.i64(i64 %i, i64 1)
  %i.next = extractvalue {{ i64, i1 }} %both, 0
  %end = extractvalue {{ i64, i1 }} %both, 1
  br i1 %end, label %over, label %back
back:
  br label %head
over:
  ret void
}}
"""
    # entry 1; each round 4 at the head, and one behind it in all but the last; the end 1
    assert bound_of(text, "f") == Bound(1 + 4 * rounds + (rounds - 1) + 1)


def test_bits_that_are_taken_one_by_one():
    text = """
define i64 @f(ptr %p, i64 %mask) {
entry:
  %none = icmp eq i64 %mask, 0
  br i1 %none, label %over, label %head
head:
  %m = phi i64 [ %mask, %entry ], [ %rest, %head ]
  %less = add i64 %m, -1
  %rest = and i64 %less, %m
  %end = icmp eq i64 %rest, 0
  br i1 %end, label %over, label %head
over:
  ret i64 0
}
"""
    assert bound_of(text, "f") == Bound(2 + 65 * 4 + 1)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (loop("%n"), "of f, at head"),
        (loop("10", compared="sgt", step=1).replace("sgt i64 %i, 10", "sgt i64 10, %n"), "of f, at head"),
        (loop("10", body="  call void @llvm.memset.p0.i64(ptr %p, i8 0, i64 %n, i1 false)\n"), "memset"),
        (loop("10", body="  call void %p()\n"), "not known"),
        (loop("11", compared="ne", step=2).replace("nsw ", ""), "of f, at head"),
        (loop("100000000000"), "of f, at head"),
    ],
)
def test_what_has_no_bound_is_named(text, named):
    bound = bound_of(text, "f")
    assert bound.operations is None
    assert bound.calls == {}
    assert named in bound.reason


class Cells(NamedTuple):
    """Parameters."""

    gain: float


def function_of(compiled, cells=6):
    """A kernel of some cells as a function of a component."""
    sample = (Cells(1.5), np.zeros(cells))
    arguments = ("p", "voltages")
    return Function("counted", "counted", compiled, (PARAMETERS, INPUT), arguments, sample, False, "_step", "")


@kernel
def _every_pair(p: Cells, voltages) -> float:
    total = 0.0
    for _ in range(50):
        for i in range(voltages.shape[0]):
            total = p.gain * total + voltages[i]
    return total


@kernel
def _some(p: Cells, voltages) -> float:
    total = 0.0
    for k in range(40):
        if voltages[k % 6] > p.gain:
            total += np.sin(voltages[k % 6])
        elif total > 3.0:
            break
    return total


@kernel
def _until_small(p: Cells, voltages) -> float:
    x = voltages[0]
    while x > p.gain:
        x = x * 0.5
    return x


def flown(library, inputs):
    """Calls of a kernel with some inputs."""
    listener = Listener(library)
    step = listener.around(library.function.kernel)
    for voltages in inputs:
        step(library.function.sample[0], np.array(voltages))
    return listener.calls


def test_a_kernel_without_branches_makes_what_it_makes_at_most():
    library = made_library(load_mission("okeefe_2013"), function_of(_every_pair))
    code = library.for_target(HOST)
    calls = flown(library, [[0.1] * 6, [np.nan] * 6])
    assert [cost[OPERATIONS] for cost in counted(library, code.text, calls)] == [code.bound.operations] * 2
    assert code.bound.operations is not None and code.bound.operations >= 50 * 6 * 2


def test_a_kernel_with_branches_makes_no_more_than_it_can():
    library = made_library(load_mission("okeefe_2013"), function_of(_some))
    code = library.for_target(HOST)
    some, most = ([0.0, 4.0, 0.0, 4.0, 4.0, 9.0], [4.0] * 6)
    each = [flown(library, [values]) for values in (some, most)]
    few, many = (most_counted(library, code.text, calls) for calls in each)
    assert code.bound.calls == {"sin": 40} and many["sin"] == 40 > few["sin"]
    assert code.bound.operations is not None
    assert few[OPERATIONS] < many[OPERATIONS] <= code.bound.operations


def test_a_kernel_that_goes_on_until_a_number_is_small_has_no_bound():
    library = made_library(load_mission("okeefe_2013"), function_of(_until_small))
    bound = library.for_target(HOST).bound
    assert bound.operations is None
    assert "no bound was found of a loop" in bound.reason
    assert "_until_small" in bound.reason or "counted" in bound.reason


def test_counters_stand_in_every_block():
    kinds, text = with_counters(loop("10"))
    assert kinds == [OPERATIONS]
    assert text.count("store i64") == 4


def test_what_is_cleared_of_an_unknown_length_is_counted_once():
    cleared = "  call void @llvm.memset.p0.i64(ptr %p, i8 0, i64 {}, i1 false)\n"
    counts = [with_counters(loop("10", cleared.format(length)))[1] for length in ("%n", "16")]
    # with the sum and the branch of that block, and two words of 64 bits
    assert ["add i64 %sunpoint" in text for text in counts] == [True, True]
    assert ".old, 3\n" in counts[0] and ".old, 5\n" in counts[1]
