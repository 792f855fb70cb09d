# SPDX-License-Identifier: Apache-2.0
"""What stands beside a compiled kernel, as intermediate code: its data, and the functions that set up and check."""

import struct
from typing import Any

from css_export.layout import FLAG, REAL, SINGLE, Scalar, Struct, leaves, pack
from css_export.limits import Limit

NEVER = "sunpoint_exception"
"""Symbol that is called where an exception comes; code that still calls it must not fly."""

# from so many numbers on a table in read-only data is shorter than the code that would store them
_MOST_STORES = 1500


def step_text(prefix: str, symbol: str) -> str:
    """The step with C's calling convention, around the entry that numba made.

    What an exception would call is nowhere: its call is still there after optimisation if an exception can come.
    """
    return f"""
declare i32 @"{symbol}"(ptr, ptr, ptr, ptr, ptr, ptr)
declare void @{NEVER}(ptr)
define void @{prefix}_step(ptr %p, ptr %s, ptr %i, ptr %o) nounwind {{
  %result = alloca ptr
  %exception = alloca ptr
  %status = call i32 @"{symbol}"(ptr %result, ptr %exception, ptr %p, ptr %s, ptr %i, ptr %o)
  %raised = icmp ne i32 %status, 0
  br i1 %raised, label %bad, label %good
bad:
  %what = load ptr, ptr %exception
  call void @{NEVER}(ptr %what)
  ret void
good:
  ret void
}}
"""


def constant_text(name: str, layout: Struct, data: bytes | bytearray) -> str:
    """A constant struct of given bytes (little-endian, as `layout.pack` gives them), in the order of the target."""
    parts, at = [], 0
    for _, scalar, offset in leaves(layout):
        parts += _gap(offset - at)
        parts.append(_number(scalar, data, offset))
        at = offset + scalar.size
    parts += _gap(layout.size - at)
    parts = parts or ["i8 0"]
    kinds = ", ".join(part.rpartition(" ")[0] for part in parts)
    return f"@{name} = constant <{{ {kinds} }}> <{{ {', '.join(parts)} }}>, align 8\n"


def _gap(size: int) -> list[str]:
    return [f"[{size} x i8] zeroinitializer"] if size > 0 else []


def _number(scalar: Scalar, data: bytes | bytearray, offset: int) -> str:
    value = struct.unpack_from("<" + scalar.code, data, offset)[0]
    if scalar is REAL or scalar is SINGLE:
        bits = struct.unpack("<Q", struct.pack("<d", value))[0]
        return f"{'double' if scalar is REAL else 'float'} 0x{bits:016X}"
    if scalar is FLAG:
        return f"i8 {int(value)}"
    return f"i{8 * scalar.size} {value}"


def init_text(prefix: str, layout: Struct, value: Any) -> str:
    """`init`, which writes the state before the first cycle."""
    data = pack(layout, value)
    stores = [
        f"  %a{i} = getelementptr i8, ptr %s, i32 {offset}\n  store {_number(scalar, data, offset)}, ptr %a{i}\n"
        for i, (_, scalar, offset) in enumerate(leaves(layout))
        if any(data[offset : offset + scalar.size])
    ]
    if len(stores) > _MOST_STORES:
        return f"""
{constant_text(f"{prefix}_initial", layout, data)}
declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)
define void @{prefix}_init(ptr %s) nounwind {{
  call void @llvm.memcpy.p0.p0.i64(ptr %s, ptr @{prefix}_initial, i64 {layout.size}, i1 false)
  ret void
}}
"""
    return f"""
declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)
define void @{prefix}_init(ptr %s) nounwind {{
  call void @llvm.memset.p0.i64(ptr %s, i8 0, i64 {layout.size}, i1 false)
{"".join(stores)}  ret void
}}
"""


def version_text(prefix: str, version: str) -> str:
    """The version as a text in read-only data."""
    return _text_constant(f"{prefix}_version", version)


def _text_constant(name: str, text: str) -> str:
    raw = text.encode("ascii", "replace") + b"\0"
    shown = "".join(f"\\{byte:02X}" for byte in raw)
    return f'@{name} = constant [{len(raw)} x i8] c"{shown}"\n'


def limits_text(prefix: str, limits: list[Limit]) -> str:
    """The table of limits and `check`."""
    texts, rows = [], []
    for k, limit in enumerate(limits):
        texts.append(_text_constant(f"{prefix}_n{k}", limit.name))
        texts.append(_text_constant(f"{prefix}_u{k}", limit.unit))
        bounds = ", ".join(_number(REAL, struct.pack("<d", bound), 0) for bound in (limit.low, limit.high))
        rows.append(
            f"%limit {{ ptr @{prefix}_n{k}, ptr @{prefix}_u{k}, {bounds}, "
            f"i32 {limit.offset}, i32 {limit.kind}, i32 {limit.count} }}"
        )
    count = len(rows)
    return f"""
%limit = type {{ ptr, ptr, double, double, i32, i32, i32 }}
{"".join(texts)}@{prefix}_limits = constant [{count} x %limit] [ {", ".join(rows)} ]
define i32 @{prefix}_check(ptr %p) nounwind {{
entry:
  br label %rows
rows:
  %k = phi i32 [ 0, %entry ], [ %k.next, %row.done ]
  %more = icmp ult i32 %k, {count}
  br i1 %more, label %row, label %good
row:
  %e = getelementptr [{count} x %limit], ptr @{prefix}_limits, i32 0, i32 %k
  %low.at = getelementptr %limit, ptr %e, i32 0, i32 2
  %low = load double, ptr %low.at
  %high.at = getelementptr %limit, ptr %e, i32 0, i32 3
  %high = load double, ptr %high.at
  %offset.at = getelementptr %limit, ptr %e, i32 0, i32 4
  %offset = load i32, ptr %offset.at
  %kind.at = getelementptr %limit, ptr %e, i32 0, i32 5
  %kind = load i32, ptr %kind.at
  %count.at = getelementptr %limit, ptr %e, i32 0, i32 6
  %count = load i32, ptr %count.at
  %base = getelementptr i8, ptr %p, i32 %offset
  br label %items
items:
  %j = phi i32 [ 0, %row ], [ %j.next, %item.done ]
  %inside = icmp ult i32 %j, %count
  br i1 %inside, label %item, label %row.done
item:
  switch i32 %kind, label %real [ i32 1, label %flag i32 2, label %whole i32 3, label %single ]
real:
  %r.at = getelementptr double, ptr %base, i32 %j
  %r = load double, ptr %r.at
  br label %judge
flag:
  %f.at = getelementptr i8, ptr %base, i32 %j
  %f.raw = load i8, ptr %f.at
  %f = uitofp i8 %f.raw to double
  br label %judge
whole:
  %w.at = getelementptr i64, ptr %base, i32 %j
  %w.raw = load i64, ptr %w.at
  %w = sitofp i64 %w.raw to double
  br label %judge
single:
  %s.at = getelementptr float, ptr %base, i32 %j
  %s.raw = load float, ptr %s.at
  %s = fpext float %s.raw to double
  br label %judge
judge:
  %v = phi double [ %r, %real ], [ %f, %flag ], [ %w, %whole ], [ %s, %single ]
  %above = fcmp oge double %v, %low
  %below = fcmp ole double %v, %high
  %ok = and i1 %above, %below
  br i1 %ok, label %item.done, label %bad
item.done:
  %j.next = add i32 %j, 1
  br label %items
row.done:
  %k.next = add i32 %k, 1
  br label %rows
bad:
  ret i32 %k
good:
  ret i32 -1
}}
"""
