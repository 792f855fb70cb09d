# SPDX-License-Identifier: Apache-2.0
"""Philox4x32-10 against the known answers of the Random123 library (Salmon et al. 2011)."""

import numpy as np
import pytest

from css_common.normal_distribution import normal_quantile
from css_common.random_streams import Stream, normal4, philox4x32, random_key, uniform4

ONES = 0xFFFFFFFF
KNOWN_ANSWERS = {
    "zeros": ((0,) * 4, (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    "ones": ((ONES,) * 4, (ONES, ONES), (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    "digits of pi": (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
}


@pytest.mark.parametrize("name", KNOWN_ANSWERS)
def test_known_answers(name):
    counter, key, expected = KNOWN_ANSWERS[name]
    assert tuple(map(int, philox4x32(*counter, *key))) == expected


def test_a_draw_is_philox_of_case_stream_step_and_index_under_the_seed():
    seed, case, step, index = 0x299F31D0_A4093822, 0x243F6A88, 0x13198A2E, 0x03707344
    words = philox4x32(case, Stream.CELL_NOISE, step, index, seed & ONES, seed >> 32)
    drawn = uniform4(random_key(seed, case), Stream.CELL_NOISE, step, index)
    assert drawn == tuple((int(word) + 0.5) / 2.0**32 for word in words)


def test_smallest_and_largest_words_stay_inside_the_open_interval():
    # the conversion, at both ends of what a word can be
    assert 0.0 < 0.5 * 2.0**-32 < (ONES + 0.5) * 2.0**-32 < 1.0
    assert np.isfinite([normal_quantile(0.5 * 2.0**-32), normal_quantile((ONES + 0.5) * 2.0**-32)]).all()


def test_normals_are_quantiles_of_the_same_draw():
    key = random_key(7, 3)
    uniforms = uniform4(key, Stream.GYRO_NOISE, 10, 2)
    assert normal4(key, Stream.GYRO_NOISE, 10, 2) == tuple(normal_quantile(u) for u in uniforms)
