# SPDX-License-Identifier: Apache-2.0
"""A kernel behind an interface of C structs, as LLVM's intermediate code.

The function that is compiled is the kernel itself, with the options of `css_common.kernel`; around it stand loads from
a struct of parameters, one of state and one of inputs, and stores into those of state and outputs. Arrays of the
state are advanced where they lie.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from css_export.comments import comments_of
from css_export.errors import ExportError
from css_export.flown import INPUT, MEMORY, OUTPUT, PARAMETERS, STATE, Function
from css_export.intermediate import kept_module
from css_export.layout import Array, Layout, Scalar, Struct, layout_of, struct_of

POINTER = types.CPointer(types.uint8)
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": False,
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}


@dataclass(frozen=True)
class Interface:
    """The structs of a function, and which arguments their members are.

    Attributes:
        structs: by role, PARAMETERS, STATE, INPUT and OUTPUT.
        fields: role of the struct and place in it of each argument.
        output: type of numba of what the kernel gives.
    """

    structs: dict[str, Struct]
    fields: tuple[tuple[str, int], ...]
    output: Any


@dataclass(frozen=True)
class Native:
    """A function as numba has compiled it for this machine, as the nodes call it.

    Attributes:
        address: of the entry, which has the calling convention of numba and takes four pointers.
        dispatcher: with which the code goes.
    """

    address: int
    dispatcher: Any


@dataclass(frozen=True)
class Compiled:
    """A function as intermediate code.

    Attributes:
        text: the module.
        symbol: of the entry, which has the calling convention of numba and takes four pointers.
    """

    interface: Interface
    text: str
    symbol: str
    native: Native


def compile_function(function: Function) -> Compiled:
    """Compiles a kernel behind its interface.

    Raises:
        ExportError: it has an argument or a result that C cannot have.
    """
    kinds = tuple(numba.typeof(value) for value in function.sample)
    structs, fields = _structs(function, kinds)
    given: dict[str, Any] = {}
    entry = _entry(function, kinds, structs, fields, given)
    signature = types.void(POINTER, POINTER, POINTER, POINTER)
    try:
        dispatcher: Any = numba.njit(**_OPTIONS)(entry)
        with kept_module(entry.__name__) as texts:
            dispatcher.compile(signature.args)
    except numba.core.errors.NumbaError as error:
        raise ExportError(f"{function.name}: not compiled: {str(error).strip().splitlines()[0]}") from error
    overload = dispatcher.overloads[signature.args]
    structs[OUTPUT] = given["struct"]
    interface = Interface(structs, tuple(fields), given["type"])
    symbol = overload.fndesc.llvm_func_name
    native = Native(overload.library.get_pointer_to_function(symbol), dispatcher)
    (text,) = texts
    return Compiled(interface, text, symbol, native)


def interface_of(function: Function, output: Any) -> Interface:
    """The interface of a function, without compiling it.

    Args:
        function: the kernel.
        output: type of numba of what it gives.
    """
    structs, fields = _structs(function, tuple(numba.typeof(value) for value in function.sample))
    structs[OUTPUT] = output_struct(function, output)
    return Interface(structs, tuple(fields), output)


def _structs(function: Function, kinds: tuple[Any, ...]) -> tuple[dict[str, Struct], list[tuple[str, int]]]:
    """The structs of parameters, state and inputs, and where each argument is; that of outputs is known later."""
    layouts = [
        layout_of(kind, value, f"{function.name}.{name}", comments_of)
        for kind, value, name in zip(kinds, function.sample, function.arguments, strict=True)
    ]
    structs: dict[str, Struct] = {}
    fields = [("", 0)] * len(layouts)
    (p,) = function.places(PARAMETERS)
    parameters = layouts[p]
    if not isinstance(parameters, Struct):
        raise ExportError(f"{function.name}: its parameters are a {kinds[p]}, expected a NamedTuple")
    structs[PARAMETERS] = parameters
    fields[p] = PARAMETERS, -1
    for struct_role, roles in ((STATE, (STATE, MEMORY)), (INPUT, (INPUT,))):
        members: list[tuple[str, Layout]] = []
        for i, role in enumerate(function.roles):
            if role in roles:
                fields[i] = struct_role, len(members)
                members.append((function.arguments[i], layouts[i]))
        structs[struct_role] = struct_of(struct_role, members, lambda name: function.docs.get(name, ""))
    written = function.places(OUTPUT)
    for place, i in enumerate(written):
        fields[i] = OUTPUT, place
    return structs, fields


def output_struct(function: Function, output: Any) -> Struct:
    """The struct of outputs: the arrays that are written, then what the kernel gives, member by member."""
    members: list[tuple[str, Layout]] = []
    for i in function.places(OUTPUT):
        kind, value = numba.typeof(function.sample[i]), function.sample[i]
        members.append((function.arguments[i], layout_of(kind, value, function.arguments[i], comments_of)))
    result = layout_of(output, None, f"{function.name}: its result", comments_of)
    told: dict[str, str] = dict(function.docs)
    if isinstance(result, Struct):
        told |= {field.name: field.comment for field in result.fields}
        members += [(field.name, field.layout) for field in result.fields]
    else:
        members.append(("result", result))
    return struct_of(OUTPUT, members, lambda name: told.get(name, ""))


def _entry(
    function: Function,
    kinds: tuple[Any, ...],
    structs: dict[str, Struct],
    fields: list[tuple[str, int]],
    given: dict[str, Any],
) -> Callable[..., None]:
    """The function in Python that is compiled."""
    names: dict[str, Any] = {"kernel": function.kernel, "zero": _zeroing(function, given)}
    calls, pointers = [], {PARAMETERS: "p", STATE: "s", INPUT: "i", OUTPUT: "o"}
    for i, (kind, value) in enumerate(zip(kinds, function.sample, strict=True)):
        role, place = fields[i]
        if role == OUTPUT:
            names[f"a{i}"] = _loader_of_output(function, kind, value, place, given)
        else:
            field = structs[role].fields[place] if place >= 0 else None
            layout = structs[role] if field is None else field.layout
            names[f"a{i}"] = _loader(kind, value, layout, 0 if field is None else field.offset)
        calls.append(f"a{i}({pointers[role]})")
    text = f"def entry(p, s, i, o):\n    zero(o)\n    result = kernel({', '.join(calls)})\n"
    if function.keeps_state:
        state = function.places(STATE)[0]
        field = structs[STATE].fields[fields[state][1]]
        names["keep"] = _storer(kinds[state], field.layout, field.offset, f"{function.name}: its state")
        text += "    keep(s, result[0])\n    give(o, result[1])\n"
    else:
        text += "    give(o, result)\n"
    names["give"] = _giver(function, given)
    exec(compile(text, f"<entry of {function.name}>", "exec"), names)  # the text is the one above
    return names["entry"]


def _zeroing(function: Function, given: dict[str, Any]) -> Any:
    """Arrays that are written are zeros before, as the components have them."""
    size = sum(_written_sizes(function))

    @intrinsic
    def zero(typing_context, pointer) -> Any:
        def code(context, builder, signature, values) -> Any:
            if size:
                kind = ir.ArrayType(ir.IntType(8), size)
                builder.store(ir.Constant(kind, None), builder.bitcast(values[0], kind.as_pointer()), align=1)
            return context.get_dummy_value()

        return types.void(pointer), code

    return zero


def _written_sizes(function: Function) -> list[int]:
    return [8 * function.sample[i].size for i in function.places(OUTPUT)]


def _loader(kind: Any, value: Any, layout: Layout, offset: int) -> Any:
    @intrinsic
    def load(typing_context, pointer) -> Any:
        def code(context, builder, signature, values) -> Any:
            return _loaded(context, builder, kind, value, layout, values[0], offset)

        return kind(pointer), code

    return load


def _loader_of_output(function: Function, kind: Any, value: Any, place: int, given: dict[str, Any]) -> Any:
    # all are reals, so that they follow one another from the begin of the struct
    offset = sum(_written_sizes(function)[:place])
    layout = layout_of(kind, value, function.name, comments_of)
    return _loader(kind, value, layout, offset)


def _storer(kind: Any, layout: Layout, offset: int, where: str) -> Any:
    @intrinsic
    def store(typing_context, pointer, given) -> Any:
        if not typing_context.can_convert(given, kind):
            raise ExportError(f"{where}: of type {given} after a cycle, before it was {kind}")

        def code(context, builder, signature, values) -> Any:
            value = context.cast(builder, values[1], signature.args[1], kind)
            _store(context, builder, kind, value, layout, values[0], offset)
            return context.get_dummy_value()

        return types.void(pointer, given), code

    return store


def _giver(function: Function, known: dict[str, Any]) -> Any:
    @intrinsic
    def give(typing_context, pointer, output) -> Any:
        struct = output_struct(function, output)
        known["struct"], known["type"] = struct, output
        first = len(function.places(OUTPUT))

        def code(context, builder, signature, values) -> Any:
            if isinstance(layout_of(output, None, "", comments_of), Struct):
                for i, part in enumerate(output.types):
                    field = struct.fields[first + i]
                    value = builder.extract_value(values[1], i)
                    _store(context, builder, part, value, field.layout, values[0], field.offset)
            else:
                field = struct.fields[first]
                _store(context, builder, output, values[1], field.layout, values[0], field.offset)
            return context.get_dummy_value()

        return types.void(pointer, output), code

    return give


def _at(builder: Any, pointer: Any, offset: int, kind: Any) -> Any:
    place = builder.gep(pointer, [ir.Constant(ir.IntType(32), offset)])
    return builder.bitcast(place, kind.as_pointer())


def _loaded(context: Any, builder: Any, kind: Any, value: Any, layout: Layout, pointer: Any, offset: int) -> Any:
    """The value of a type at an offset."""
    if isinstance(kind, types.NoneType):
        return context.get_dummy_value()
    if isinstance(kind, types.Array):
        array = make_array(kind)(context, builder)
        size = value.itemsize
        strides = [ir.Constant(context.get_value_type(types.intp), s) for s in value.strides]
        shape = [ir.Constant(context.get_value_type(types.intp), n) for n in value.shape]
        data = _at(builder, pointer, offset, context.get_data_type(kind.dtype))
        populate_array(
            array,
            data=data,
            shape=shape,
            strides=strides,
            itemsize=context.get_constant(types.intp, size),
            meminfo=None,
        )
        return array._getvalue()
    if isinstance(layout, Scalar):
        raw = builder.load(_at(builder, pointer, offset, context.get_data_type(kind)))
        return context.data_model_manager[kind].from_data(builder, raw)
    parts = [
        _loaded(context, builder, part, None if value is None else value[i], place, pointer, offset + at)
        for i, (part, (place, at)) in enumerate(zip(kind.types, _places(layout, len(kind.types)), strict=True))
    ]
    return context.make_tuple(builder, kind, parts)


def _store(context: Any, builder: Any, kind: Any, value: Any, layout: Layout, pointer: Any, offset: int) -> None:
    if isinstance(kind, types.NoneType):
        return
    if isinstance(layout, Scalar):
        raw = context.data_model_manager[kind].as_data(builder, value)
        builder.store(raw, _at(builder, pointer, offset, context.get_data_type(kind)))
        return
    for i, (part, (place, at)) in enumerate(zip(kind.types, _places(layout, len(kind.types)), strict=True)):
        _store(context, builder, part, builder.extract_value(value, i), place, pointer, offset + at)


def _places(layout: Layout, count: int) -> list[tuple[Layout, int]]:
    if isinstance(layout, Array):
        return [(layout.element, i * layout.element.size) for i in range(count)]
    assert isinstance(layout, Struct)
    return [(field.layout, field.offset) for field in layout.fields]
