# SPDX-License-Identifier: Apache-2.0
"""The folder of a study: its parameters, chunks while it runs, results when it is done. Every file appears whole.

study.json           what was asked for; a folder made with other parameters is refused
mission.yaml         the mission, where it disperses parameters
chunks/              finished pieces of an unfinished study
cases.parquet        one row per configuration and case
percentiles.parquet  one row per configuration, quantity and time; written last: a study with it is complete
"""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from css_analysis.errors import StudyError
from css_analysis.study_record import CASES, MANIFEST, PERCENTILES, is_complete

CHUNKS = "chunks"


class StudyFolder:
    """A folder, new or of an earlier start of the same study."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def prepare(self, manifest: dict[str, Any]) -> None:
        """Makes the folder, or checks that it holds the same study.

        Raises:
            StudyError: it cannot be written, holds something else, or a study with other parameters.
        """
        found = self.path / MANIFEST
        try:
            if found.exists():
                self._check_same(manifest)
                return
            if self.path.exists() and any(self.path.iterdir()):
                raise StudyError(f"{self.path}: holds files but no study, expected an empty or new folder")
            (self.path / CHUNKS).mkdir(parents=True, exist_ok=True)
            self._write(found, json.dumps(manifest, indent=1).encode())
        except OSError as error:
            raise StudyError(f"{self.path}: cannot be written: {error.strerror}") from error

    def keep(self, name: str, text: str) -> None:
        """Keeps a text as a file of the folder.

        Raises:
            StudyError: the disk says no.
        """
        try:
            self._write(self.path / name, text.encode())
        except OSError as error:
            raise StudyError(f"{self.path / name}: cannot be written: {error.strerror}") from error

    @property
    def complete(self) -> bool:
        """All results are there."""
        return is_complete(self.path)

    def has_chunk(self, name: str) -> bool:
        """That piece is done."""
        return self._chunk(name).exists()

    def write_chunk(self, name: str, data: bytes) -> None:
        """Keeps a finished piece.

        Raises:
            StudyError: the disk says no.
        """
        try:
            self._write(self._chunk(name), data)
        except OSError as error:
            raise StudyError(f"{self._chunk(name)}: cannot be written: {error.strerror}") from error

    def read_chunk(self, name: str, columns: list[str] | None = None) -> pa.Table:
        """Columns of a finished piece, all by default."""
        return pq.read_table(self._chunk(name), columns=columns)

    def finish(self, cases: pa.Table, percentiles: pa.Table) -> None:
        """Writes the results and drops the chunks.

        Raises:
            StudyError: the disk says no.
        """
        try:
            self._write(self.path / CASES, parquet_bytes(cases))
            self._write(self.path / PERCENTILES, parquet_bytes(percentiles))
            shutil.rmtree(self.path / CHUNKS)
        except OSError as error:
            raise StudyError(f"{self.path}: cannot be written: {error.strerror}") from error

    def _chunk(self, name: str) -> Path:
        return self.path / CHUNKS / f"{name}.parquet"

    def _check_same(self, manifest: dict[str, Any]) -> None:
        try:
            found = json.loads((self.path / MANIFEST).read_text(encoding="utf-8"))
        except ValueError as error:
            raise StudyError(f"{self.path / MANIFEST}: damaged: {error}") from error
        for key in dict.fromkeys((*manifest, *found)):
            ours, theirs = manifest.get(key), found.get(key)
            if ours != theirs:
                shown = (
                    key if isinstance(ours, (list, dict)) or key == "mission_text" else f"{key}: {theirs}, not {ours}"
                )
                raise StudyError(f"{self.path}: holds a study with other parameters ({shown}); choose another --out")

    def _write(self, path: Path, data: bytes) -> None:
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            with temporary.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)


def parquet_bytes(table: pa.Table) -> bytes:
    """A table as a Parquet file."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue().to_pybytes()
