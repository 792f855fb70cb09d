# SPDX-License-Identifier: Apache-2.0
"""What a recorder remembers of each chunk is its index record: memory grows slowly however long a flight is."""

import tracemalloc

from css_recording.chunk_builder import ChunkBuilder

CHUNKS, CHANNELS, MESSAGES = 2000, 7, 10


def test_a_chunk_costs_little_more_than_its_record():
    builder = ChunkBuilder()

    def write(first: int, count: int) -> None:
        for chunk in range(first, first + count):
            stamp = chunk * 10**9
            messages = ((c, m, stamp + m, stamp + m, bytes(40)) for m in range(MESSAGES) for c in range(CHANNELS))
            assert builder.fill(iter(messages), 1 << 20)
            builder.finish(chunk * 1000)

    write(0, 100)
    tracemalloc.start()
    try:
        write(100, CHUNKS)
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    record = len(builder.indexes) / (CHUNKS + 100)
    assert builder.statistics(0, 0, 0, 0).chunk_count == CHUNKS + 100
    assert record < 200  # bytes: nine numbers, the name of the compression, one place for each channel
    # an array that grows has room for an eighth more, and may hold an old copy while it moves
    assert grown / CHUNKS < 2.0 * record + 50.0
