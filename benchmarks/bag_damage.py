# SPDX-License-Identifier: Apache-2.0
"""Ways in which a recording on disk gets damaged, and a few in which it is made to do harm."""

import os
import random
import shutil
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import lz4.frame
import zstandard

from css_recording.bag_metadata import METADATA_FILE
from css_recording.mcap_chunk import CHUNK_HEAD, RECORD_HEAD
from css_recording.mcap_file import McapFile

_BOMB_BYTES = 300 << 20


def _any_file(bag: Path, dice: random.Random) -> Path:
    return dice.choice(sorted(path for path in bag.iterdir() if path.name != METADATA_FILE))


def _edit(bag: Path, dice: random.Random, change: Callable[[bytearray], bytes | bytearray]) -> None:
    file = _any_file(bag, dice)
    file.write_bytes(change(bytearray(file.read_bytes())))


def flip_bits(bag: Path, dice: random.Random) -> None:
    """One to four bits of a file."""

    def change(data: bytearray) -> bytearray:
        for _ in range(dice.choice((1, 1, 1, 4))):
            data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
        return data

    _edit(bag, dice, change)


def flip_outside_chunks(bag: Path, dice: random.Random) -> None:
    """One bit of the first 40 kB or of the last 20 kB of a file: mission, definitions, index."""

    def change(data: bytearray) -> bytearray:
        places = [*range(min(len(data), 40_000)), *range(max(0, len(data) - 20_000), len(data))]
        data[dice.choice(places)] ^= 1 << dice.randrange(8)
        return data

    _edit(bag, dice, change)


def cut(bag: Path, dice: random.Random) -> None:
    """The end of a file, and sometimes metadata.yaml with it: a recorder that was killed."""
    _edit(bag, dice, lambda data: data[: dice.randrange(len(data))])
    if dice.random() < 0.5:
        (bag / METADATA_FILE).unlink()


def insert(bag: Path, dice: random.Random) -> None:
    """Some bytes in the midst of a file."""

    def change(data: bytearray) -> bytearray:
        at = dice.randrange(len(data))
        return data[:at] + dice.randbytes(dice.randint(1, 100)) + data[at:]

    _edit(bag, dice, change)


def blank(bag: Path, dice: random.Random) -> None:
    """A block that reads as zeros: a bad sector."""

    def change(data: bytearray) -> bytearray:
        at = dice.randrange(len(data)) // 512 * 512
        data[at : at + 4096] = bytes(len(data[at : at + 4096]))
        return data

    _edit(bag, dice, change)


def _chunk_records(file: Path) -> list[slice]:
    reader = McapFile(file)
    places = [slice(c.position, c.position + RECORD_HEAD.size + c.size) for c in reader.chunks]
    reader.close()
    return places


def rearrange_chunks(bag: Path, dice: random.Random) -> None:
    """Two chunks of a file swapped, one removed or one written twice."""
    file = _any_file(bag, dice)
    if file.suffix != ".mcap":
        return flip_bits(bag, dice)
    data = file.read_bytes()
    first, second = sorted(dice.sample(_chunk_records(file), 2), key=lambda place: place.start)
    a, b = data[first], data[second]
    a, b = dice.choice(((b, a), (a, b"") if dice.random() < 0.5 else (b"", b), (a + a, b)))
    file.write_bytes(data[: first.start] + a + data[first.stop : second.start] + b + data[second.stop :])
    return None


def _bomb(dice: random.Random) -> bytes:
    """A chunk of a few kilobytes that unpacks to hundreds of megabytes, or says so, or does not say so."""
    zeros = bytes(_BOMB_BYTES)
    name, packed = dice.choice((("zstd", zstandard.compress(zeros)), ("lz4", lz4.frame.compress(zeros))))
    if name == "zstd" and dice.random() < 0.5:
        packed = zstandard.ZstdCompressor(write_content_size=False).compress(zeros)
    stated = dice.choice((_BOMB_BYTES, 1 << 10, 200 << 20, 1 << 40, (1 << 64) - 1))
    stamp_ns = 1_370_044_805_000_000_000
    head = CHUNK_HEAD.pack(stamp_ns, stamp_ns, stated, 0, len(name))
    body = head + name.encode() + struct.pack("<Q", len(packed)) + packed
    return RECORD_HEAD.pack(6, len(body)) + body


def plant_bombs(bag: Path, dice: random.Random) -> None:
    """One to five such chunks in the place of good ones, in a file without end: nothing else vouches for them."""
    file = _any_file(bag, dice)
    if file.suffix != ".mcap":
        return flip_bits(bag, dice)
    data = file.read_bytes()
    places = _chunk_records(file)
    end = places[-1].stop if dice.random() < 0.5 else len(data)
    for place in sorted(dice.sample(places, dice.randint(1, 5)), key=lambda place: -place.start):
        data = data[: place.start] + _bomb(dice) + data[place.stop : end]
        end = len(data)
    file.write_bytes(data)
    return None


def spoil_metadata(bag: Path, dice: random.Random) -> None:
    """metadata.yaml missing, cut, or with other contents."""
    path = bag / METADATA_FILE
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    line = dice.randrange(len(lines))
    spoiled = {
        "missing": None,
        "cut": text[: dice.randrange(len(text))],
        "line lost": "".join(lines[:line] + lines[line + 1 :]),
        "counts": text.replace("message_count: ", "message_count: 1"),
        "file": text.replace("_0.", "_7."),
        "foreign keys": text + "  pilot: me\nmore: [1, 2]\n",
        "tag": text.replace("version: 9", "version: !!python/object:os.system 9"),
        "deep": "[" * 20_000,
        "aliases": "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(f"{b}: &{b} [{','.join(['*' + a] * 9)}]\n" for a, b in
                                                            zip("abcdefgh", "bcdefghi", strict=True)),
        "empty": "",
        "bytes": dice.randbytes(300).decode("latin-1"),
        "storage": text.replace("storage_identifier: mcap", "storage_identifier: tape"),
        "compression": text.replace("compression_mode: ''", "compression_mode: message"),
        "twice": text.replace("file_paths:\n", f"file_paths:\n  - {_any_file(bag, dice).name}\n"),
    }[dice.choice(("missing", "cut", "line lost", "counts", "file", "foreign keys", "tag", "deep", "aliases", "empty",
                   "bytes", "storage", "compression", "twice"))]  # fmt: skip
    if spoiled is None:
        path.unlink()
    else:
        path.write_text(spoiled, encoding="utf-8")


def rename_file(bag: Path, dice: random.Random) -> None:
    """A file under another name, gone, or with one of another recording beside it."""
    file = _any_file(bag, dice)
    kind = dice.randrange(3)
    if kind == 0:
        file.rename(file.with_name(f"other{file.suffix}"))
    elif kind == 1 and len(list(bag.iterdir())) > 2:
        file.unlink()
    else:
        shutil.copyfile(file, file.with_name(f"copy_of_{file.name}"))


def disturb_sqlite(bag: Path, dice: random.Random) -> None:
    """A write-ahead log beside the file, whole or torn; rows of odd kinds."""
    file = _any_file(bag, dice)
    if file.suffix != ".db3":
        return flip_bits(bag, dice)
    with closing(sqlite3.connect(file)) as database:
        if dice.random() < 0.5:
            database.execute("PRAGMA journal_mode=WAL").fetchone()
            (rows,) = database.execute("SELECT max(id) FROM messages").fetchone()
            row = database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id DESC LIMIT 1").fetchone()
            database.execute("DELETE FROM messages WHERE id = ?", (rows,))
            database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", row)
            database.commit()
            log = Path(f"{file}-wal").read_bytes()
            main = file.read_bytes()
        else:
            value = dice.choice((None, "text", 5, -1, b"", (1 << 63) - 1, -(1 << 63)))
            column = dice.choice(("data", "timestamp", "topic_id"))
            with closing(database.cursor()) as cursor:
                try:
                    cursor.execute(f"UPDATE messages SET {column} = ? WHERE id = 77", (value,))
                    database.commit()
                except sqlite3.IntegrityError:
                    database.rollback()
            return None
    file.write_bytes(main)
    if dice.random() < 0.3:
        log = log[: dice.randrange(len(log))]
    elif dice.random() < 0.3:
        at = dice.randrange(len(log))
        log = log[:at] + bytes([log[at] ^ 4]) + log[at + 1 :]
    Path(f"{file}-wal").write_bytes(log)
    return None


def restrict(bag: Path, dice: random.Random) -> None:
    """A file that is empty, a folder in the place of a file, junk under the name of a file."""
    file = _any_file(bag, dice)
    kind = dice.randrange(3)
    if kind == 0:
        os.truncate(file, 0)
    elif kind == 1:
        file.unlink()
        file.mkdir()
    else:
        file.write_bytes(dice.randbytes(5000))


DAMAGES: dict[str, Callable[[Path, random.Random], None]] = {
    function.__name__: function
    for function in (
        flip_bits,
        flip_outside_chunks,
        cut,
        insert,
        blank,
        rearrange_chunks,
        plant_bombs,
        spoil_metadata,
        rename_file,
        disturb_sqlite,
        restrict,
    )
}
"""Name to damage; each changes the recording in a folder, by the throw of dice."""
