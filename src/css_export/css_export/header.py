# SPDX-License-Identifier: Apache-2.0
"""The header of a library: its structs, made from the tuples that the kernel takes, and its functions."""

from css_export.entry import Interface
from css_export.flown import INPUT, OUTPUT, PARAMETERS, STATE, Function
from css_export.layout import Array, Field, Layout, Scalar, Struct, layout_number
from css_export.names import comment, identifier, quoted, snake

STRUCTS = {PARAMETERS: "params", STATE: "state", INPUT: "in", OUTPUT: "out"}
_ABOUT = {
    PARAMETERS: "Parameters; {prefix}_mission holds those of the mission.",
    STATE: "What is carried from step to step; {prefix}_init sets it up. Its members are the estimator's own.",
    INPUT: "What a step is given.",
    OUTPUT: "What a step gives.",
}


def header_text(function: Function, interface: Interface, prefix: str, version: str, limits: int) -> str:
    """`sunpoint_NAME.h`."""
    guard = f"{prefix.upper()}_H"
    writer = _Writer(prefix)
    structs = "\n".join(
        writer.top(STRUCTS[role], interface.structs[role], _ABOUT[role].format(prefix=prefix)) for role in STRUCTS
    )
    # those of members come before what they are members of
    return f"""/* SPDX-License-Identifier: Apache-2.0 */
/* {comment(version)}
 *
 * {comment(function.about)}
 *
 * Made by `sunpoint export`: changes are lost. Numbers are SI and radians; _b: body frame, _n: inertial frame;
 * uint8_t members are flags of 0 or 1. No function allocates, and none keeps anything but what it is given.
 */
#ifndef {guard}
#define {guard}

#include <stdint.h>

#ifdef __cplusplus
extern "C" {{
#endif

#define {prefix.upper()}_VERSION {quoted(version)}
/* Another number: other structs. A library of your own has `const uint64_t {prefix}_layout` of this value. */
#define {prefix.upper()}_LAYOUT UINT64_C(0x{layout_number(interface.structs):016x})

{structs}
/* Within what a number of the parameters, or several that follow one another, must lie. */
typedef struct {prefix}_limit {{
    const char *name;
    const char *unit;
    double low;
    double high;
    uint32_t offset; /* [bytes] in the parameters */
    uint32_t kind;   /* 0 double, 1 flag, 2 int64_t, 3 float */
    uint32_t count;
}} {prefix}_limit;

/* Sets the state up as before the first step of the mission. */
void {prefix}_init({prefix}_state *state);

/* One step. All pointers are to distinct structs. */
void {prefix}_step(const {prefix}_params *params, {prefix}_state *state, const {prefix}_in *in, {prefix}_out *out);

/* Which limit is not kept, as an index into {prefix}_limits, or -1. Not a number keeps none. */
int32_t {prefix}_check(const {prefix}_params *params);

extern const {prefix}_params {prefix}_mission;
extern const {prefix}_limit {prefix}_limits[{max(limits, 1)}];
extern const uint64_t {prefix}_layout;
extern const char {prefix}_version[{len(version.encode("ascii", "replace")) + 1}];

#ifdef __cplusplus
}}
#endif

#endif
"""


class _Writer:
    """Names the structs of a header, each once."""

    def __init__(self, prefix: str) -> None:
        self._prefix = prefix
        self._named: dict[Struct, str] = {}
        self._taken: set[str] = {f"{prefix}_{name}" for name in (*STRUCTS.values(), "limit", "mission", "limits")}

    def top(self, name: str, struct: Struct, about: str) -> str:
        """Definition of a struct of the interface, after those of its members."""
        before = "".join(self._definitions(struct, name))
        full = f"{self._prefix}_{name}"
        return f"{before}/* {comment(about)} */\n{self._body(struct, full)}"

    def _definitions(self, struct: Struct, where: str) -> list[str]:
        texts = []
        for field in struct.fields:
            inner = _innermost(field.layout)
            if not field.layout.size or not isinstance(inner, Struct) or inner in self._named:
                continue
            texts += self._definitions(inner, field.name)
            self._named[inner] = self._new_name(inner, field.name)
            texts.append(self._body(inner, self._named[inner]))
        return texts

    def _new_name(self, struct: Struct, where: str) -> str:
        base = where if struct.name in ("row", "tuple") else struct.name
        name = wanted = f"{self._prefix}_{snake(base)}"
        number = 2
        while name in self._taken:
            name = f"{wanted}_{number}"
            number += 1
        self._taken.add(name)
        return name

    def _body(self, struct: Struct, name: str) -> str:
        members = [self._member(field) for field in struct.fields if field.layout.size]
        if not members:
            return f"typedef struct {name} {{\n    uint8_t nothing; /* it has no members */\n}} {name};\n\n"
        check = f"typedef char {name}_has_{struct.size}_bytes[(sizeof({name}) == {struct.size}u) ? 1 : -1];\n"
        return f"typedef struct {name} {{\n{''.join(members)}}} {name};\n{check}\n"

    def _member(self, field: Field) -> str:
        inner, counts = field.layout, ""
        while isinstance(inner, Array):
            counts += f"[{inner.count}]"
            inner = inner.element
        kind = inner.name if isinstance(inner, Scalar) else self._named[inner]
        said = f" /* {comment(field.comment)} */" if field.comment else ""
        return f"    {kind} {identifier(field.name)}{counts};{said}\n"


def _innermost(layout: Layout) -> Layout:
    while isinstance(layout, Array):
        layout = layout.element
    return layout
