# SPDX-License-Identifier: Apache-2.0
"""A program in C that steps a library over a stream of inputs, and the stream.

The stream is made of records: a word of 64 bits says what comes, then comes it. STEP: the struct of inputs; BEGIN:
nothing, the state is set up anew; PARAMETERS, STATE: the struct of parameters, or of the state, from now on; LAYOUT:
nothing, the program writes the number of its structs. For each STEP it writes the struct of outputs and a hash of the
state after it, with an argument the state itself, at once. All in the order of bytes of the processor.

The hash is the sum, modulo 2^64, of (2 i + 1) m(w) over the words w of 64 bits of the state, with the mixing step
m(w) = (w ^ w >> 29) 0xbf58476d1ce4e5b9: every word counts, and so does its place.
"""

import struct

import numpy as np

from css_export.library_server import BEGIN, LAYOUT, PARAMETERS, STATE, STEP

__all__ = ["BEGIN", "LAYOUT", "PARAMETERS", "STATE", "STEP", "main_text", "state_hash", "word"]

_MIX = np.uint64(0xBF58476D1CE4E5B9)
_SHIFT = np.uint64(29)


def word(command: int) -> bytes:
    """The head of a record."""
    return struct.pack("<Q", command)


def state_hash(state: bytes | bytearray, kind: str = "<u8") -> int:
    """The hash of a state, whose last word is filled up with zeros.

    Args:
        state: in the order of bytes of a processor.
        kind: of its words, as numpy names it.
    """
    words = np.frombuffer(bytes(state) + bytes(-len(state) % 8), kind).astype(np.uint64)
    places = 2 * np.arange(len(words), dtype=np.uint64) + np.uint64(1)
    return int(np.sum(places * ((words ^ (words >> _SHIFT)) * _MIX), dtype=np.uint64))


def main_text(prefix: str, state_size: int) -> str:
    """`sunpoint_NAME_main.c`.

    Args:
        prefix: of the library's symbols.
        state_size: [bytes] of the state; 0: it has none.
    """
    size = "sizeof state" if state_size else "0"
    return f"""/* SPDX-License-Identifier: Apache-2.0 */
/* Steps the library over a stream of records on standard input; README.md says what stands in them. */
#include "{prefix}.h"

#include <stdio.h>
#include <string.h>

static {prefix}_params params;
static {prefix}_state state;
static {prefix}_in input;
static {prefix}_out output;

static uint64_t hash_of_state(void)
{{
    const unsigned char *bytes = (const unsigned char *)&state;
    uint64_t value = 0;
    size_t at;
    for (at = 0; at < sizeof state; at += 8) {{
        uint64_t word = 0;
        memcpy(&word, bytes + at, sizeof state - at < 8 ? sizeof state - at : 8);
        value += (2u * (at / 8) + 1u) * ((word ^ (word >> 29)) * 0xbf58476d1ce4e5b9u);
    }}
    return value;
}}

static int step_once(int with_state)
{{
    uint64_t hash;
    if (fread(&input, sizeof input, 1, stdin) != 1) {{
        return 0;
    }}
    memset(&output, 0, sizeof output);
    {prefix}_step(&params, &state, &input, &output);
    hash = hash_of_state();
    if (fwrite(&output, sizeof output, 1, stdout) != 1 || fwrite(&hash, sizeof hash, 1, stdout) != 1) {{
        return 0;
    }}
    return !with_state || (fwrite(&state, 1, {size}, stdout) == {size} && fflush(stdout) == 0);
}}

int main(int count, char **arguments)
{{
    uint64_t command;
    (void)arguments;
    params = {prefix}_mission;
    {prefix}_init(&state);
    while (fread(&command, sizeof command, 1, stdin) == 1) {{
        int done = 0;
        if (command == {STEP}u) {{
            done = step_once(count > 1);
        }} else if (command == {BEGIN}u) {{
            {prefix}_init(&state);
            done = 1;
        }} else if (command == {PARAMETERS}u) {{
            done = fread(&params, sizeof params, 1, stdin) == 1 && {prefix}_check(&params) == -1;
        }} else if (command == {STATE}u) {{
            done = fread(&state, 1, {size}, stdin) == {size};
        }} else if (command == {LAYOUT}u) {{
            done = fwrite(&{prefix}_layout, sizeof {prefix}_layout, 1, stdout) == 1 && fflush(stdout) == 0;
        }}
        if (!done) {{
            fprintf(stderr, "{prefix}: a record that cannot be read, or parameters out of their limits\\n");
            return 1;
        }}
    }}
    return fflush(stdout) == 0 ? 0 : 1;
}}
"""
