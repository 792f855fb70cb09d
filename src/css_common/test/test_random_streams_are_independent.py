# SPDX-License-Identifier: Apache-2.0
"""Statistics of the random streams at fixed seeds, and what a draw may depend on.

Every figure below is one fixed computation, not a chance: the seeds are in the file. The limits are those that true
random numbers would pass with probability 1 - 1e-4 each.
"""

import itertools
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from css_common.kernel import kernel
from css_common.random_streams import Stream, normal4, random_key, uniform4

SEED, CASE, COUNT = 20130601, 17, 4096
LIMIT = 1e-4


@kernel
def _fill_uniform(key, stream, index, out):
    for step in range(len(out)):
        out[step, 0], out[step, 1], out[step, 2], out[step, 3] = uniform4(key, stream, step, index)


@kernel
def _fill_normal(key, stream, index, out):
    for step in range(len(out)):
        out[step, 0], out[step, 1], out[step, 2], out[step, 3] = normal4(key, stream, step, index)


def drawn(fill, stream: Stream, *, seed: int = SEED, case: int = CASE, index: int = 0) -> np.ndarray:
    """(4 * COUNT,) numbers of one stream over successive steps."""
    out = np.empty((COUNT, 4))
    fill(random_key(seed, case), int(stream), index, out)
    return out.ravel()


@pytest.mark.parametrize("stream", list(Stream), ids=lambda s: s.name)
def test_each_stream_is_uniform_and_normal(stream):
    uniform = drawn(_fill_uniform, stream)
    counts, _ = np.histogram(uniform, bins=64, range=(0.0, 1.0))
    assert stats.chisquare(counts).pvalue > LIMIT
    assert stats.kstest(uniform, "uniform").pvalue > LIMIT
    assert stats.kstest(drawn(_fill_normal, stream), "norm").pvalue > LIMIT


def test_neighbouring_bits_and_words_are_not_related():
    words = drawn(_fill_uniform, Stream.CELL_NOISE).reshape(COUNT, 4)
    for a, b in itertools.combinations(range(4), 2):
        assert stats.pearsonr(words[:, a], words[:, b]).pvalue > LIMIT
    flat = words.ravel()
    for lag in (1, 2, 3, 4, 5, 8, 16):
        assert stats.pearsonr(flat[:-lag], flat[lag:]).pvalue > LIMIT


def test_streams_cases_seeds_and_indices_do_not_correlate():
    sequences = [drawn(_fill_normal, stream) for stream in Stream]
    sequences += [drawn(_fill_normal, Stream.CELL_NOISE, case=case) for case in (0, 1, 2, CASE + 1)]
    sequences += [drawn(_fill_normal, Stream.CELL_NOISE, seed=seed) for seed in (0, 1, SEED + 1, SEED << 32)]
    sequences += [drawn(_fill_normal, Stream.CELL_NOISE, index=index) for index in (1, 2, 31)]
    correlations = np.corrcoef(sequences)[np.triu_indices(len(sequences), k=1)]
    # 300 pairs: the largest of them may be that much less probable
    limit = stats.norm.isf(LIMIT / 2.0 / len(correlations)) / np.sqrt(4 * COUNT)
    assert np.abs(correlations).max() < limit
    # and together they scatter as they should, no more and no less
    scaled = correlations * np.sqrt(4 * COUNT)
    assert stats.kstest(scaled, "norm").pvalue > LIMIT


def test_streams_have_numbers_of_their_own():
    assert len({int(stream) for stream in Stream}) == len(Stream.__members__)


words = st.integers(0, 2**32 - 1)


@given(st.integers(0, 2**64 - 1), words, st.sampled_from(Stream), words, words)
def test_a_draw_repeats_whatever_was_drawn_in_between(seed, case, stream, step, index):
    key = random_key(seed, case)
    first = normal4(key, stream, step, index)
    normal4(random_key(seed ^ 1, case), stream, step, index)
    normal4(key, stream, (step + 1) % 2**32, index)
    assert normal4(random_key(seed, case), stream, step, index) == first


@given(st.integers(0, 2**64 - 1), words, st.sampled_from(Stream), words, words)
def test_every_part_of_the_counter_counts(seed, case, stream, step, index):
    base = uniform4(random_key(seed, case), stream, step, index)
    assert uniform4(random_key(seed ^ 1, case), stream, step, index) != base
    assert uniform4(random_key(seed ^ (1 << 63), case), stream, step, index) != base
    assert uniform4(random_key(seed, case ^ 1), stream, step, index) != base
    assert uniform4(random_key(seed, case), stream, step ^ 1, index) != base
    assert uniform4(random_key(seed, case), stream, step, index ^ 1) != base


def test_compiled_loops_draw_what_python_draws():
    key = random_key(SEED, CASE)
    by_hand = [normal4(key, Stream.CELL_NOISE, step, 0) for step in range(COUNT)]
    assert np.array_equal(np.ravel(by_hand), drawn(_fill_normal, Stream.CELL_NOISE))


def test_another_process_draws_the_same():
    program = (
        "from css_common.random_streams import *;"
        f"print(*map(float.hex, normal4(random_key({SEED}, {CASE}), Stream.GYRO_NOISE, 12345, 6)))"
    )
    printed = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    here = normal4(random_key(SEED, CASE), Stream.GYRO_NOISE, 12345, 6)
    assert printed.split() == [value.hex() for value in here]


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_seeds_out_of_range_are_refused(seed):
    with pytest.raises(OverflowError):
        random_key(seed, 0)


@pytest.mark.parametrize("case", [-1, 2**32])
def test_cases_out_of_range_are_refused(case):
    with pytest.raises(OverflowError):
        random_key(0, case)
