# SPDX-License-Identifier: Apache-2.0
"""Takes a serialised message together with the GID of its writer, which rclpy does not tell.

`rcl_take_serialized_message` of ROS 2 Jazzy is called by ctypes, with the structures of its public headers
(rmw/types.h, rcutils/types/uint8_array.h). Used only where a topic has several writers.
"""

import ctypes
from functools import cache
from typing import Any

_OK = 0
_TAKE_FAILED = 401  # RCL_RET_SUBSCRIPTION_TAKE_FAILED: there is no message


class _Allocator(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero", "state"))


class _Bytes(ctypes.Structure):
    _fields_ = (
        ("buffer", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    )


class _Gid(ctypes.Structure):
    _fields_ = (("implementation", ctypes.c_char_p), ("data", ctypes.c_uint8 * 16))


class _MessageInfo(ctypes.Structure):
    _fields_ = (
        ("source_timestamp", ctypes.c_int64),
        ("received_timestamp", ctypes.c_int64),
        ("publication_sequence_number", ctypes.c_uint64),
        ("reception_sequence_number", ctypes.c_uint64),
        ("publisher_gid", _Gid),
        ("from_intra_process", ctypes.c_bool),
        ("beyond", ctypes.c_uint8 * 64),  # room for fields that a later header may append
    )


@cache
def _libraries() -> tuple[Any, Any]:
    rcl, rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")
    rcl.rcl_take_serialized_message.argtypes = (ctypes.c_void_p,) * 4
    rcutils.rcutils_get_default_allocator.restype = _Allocator
    rcutils.rcutils_uint8_array_init.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
    return rcl, rcutils


@cache
def _buffer() -> _Bytes:
    """The one buffer, which the middleware enlarges as messages need it."""
    rcutils = _libraries()[1]
    buffer, allocator = _Bytes(), rcutils.rcutils_get_default_allocator()
    if rcutils.rcutils_uint8_array_init(ctypes.byref(buffer), 256, ctypes.byref(allocator)) != _OK:
        raise MemoryError("no memory for a message")
    return buffer


def take_with_writer(handle: Any) -> tuple[bytes, bytes] | None:
    """The next message of a subscription and the GID of its writer; None when there is none.

    Args:
        handle: `Subscription.handle` of rclpy.

    Raises:
        RuntimeError: the middleware refuses.
    """
    rcl, buffer, information = _libraries()[0], _buffer(), _MessageInfo()
    with handle:
        code = rcl.rcl_take_serialized_message(handle.pointer, ctypes.byref(buffer), ctypes.byref(information), None)
    if code == _TAKE_FAILED:
        return None
    if code != _OK:
        raise RuntimeError(f"rcl_take_serialized_message failed with code {code}")
    return ctypes.string_at(buffer.buffer, buffer.length), bytes(information.publisher_gid.data)
