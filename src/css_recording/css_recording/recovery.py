# SPDX-License-Identifier: Apache-2.0
"""Turns the recording of a killed recorder, or one whose index is lost, into a finished one.

A torn file is written again through `BagWriter`, which indexes it and adds what the recorder had no time for. The torn
end is dropped: no message is ever made up. The new file takes the place of the torn one in one step, so that an
interrupted recovery can be repeated. A folder gets a `metadata.yaml` that names the files that are there. At the end
the recording is opened as a reader opens it: what `recover` calls complete can be read.
"""

import shutil
from contextlib import ExitStack
from pathlib import Path

from css_recording.bag_files import bag_files, doubts, named_files, open_files, open_storage
from css_recording.bag_folder import is_being_written, sync_folder, write_atomically
from css_recording.bag_metadata import (
    METADATA_FILE,
    RECOVERY_NOTE,
    BagSummary,
    FileSummary,
    bag_information,
    metadata_text,
    read_metadata,
    recovery_note,
    ros_distro,
)
from css_recording.bag_storage import BagStorage
from css_recording.bag_writer import FLIGHT_RECORD
from css_recording.errors import BagError
from css_recording.mcap_file import McapFile
from css_recording.provenance import SEAL
from css_recording.salvage import RecoveryReport, copy_messages, damage_of, rewrite

_TEMPORARY_SUFFIX = ".recovering"


def recover(path: str | Path, output: str | Path | None = None) -> RecoveryReport:
    """Finish a recording that its recorder did not.

    Parameters
    ----------
    path: rosbag2 folder, or a bare `.mcap` file.
    output: new folder; default: the recording itself is mended, also a bare file.

    A complete recording is left as it is, or copied to `output`. Raises `BagError` when there is nothing to
    recover from, when a recorder still writes it, and when more than its end is damaged and no `output` is
    given: what cannot be read is not thrown away unasked.
    """
    source = Path(path).absolute()
    files = _files_of(source)
    for file in files:
        if is_being_written(file):
            raise BagError(f"{source}: is being written by a recorder")
    if output is not None:
        report = _save(source, files, Path(output).absolute())
    elif files[0].suffix == ".mcap" and not _is_compressed(source):
        report = _mend(source, files)
    else:
        report = _reindex(source, files, RecoveryReport(source))
    open_storage(report.recording).close()
    return report


def _files_of(source: Path) -> list[Path]:
    if source.is_file():
        return [source]
    if not source.is_dir():
        raise BagError(f"{source}: there is no such recording")
    files = bag_files(source)
    information = read_metadata(source)
    if information is not None:
        named = [source / name for name in named_files(information)]
        if all(file.is_file() for file in named) and not _miscounts(source):
            return named  # others are no part of it
    if not files:
        raise BagError(f"{source}: holds no .mcap or .db3 file to recover from")
    kinds = sorted({file.suffix for file in files})
    if len(kinds) > 1:
        raise BagError(f"{source}: holds {' and '.join(kinds)} files; recover one of them by its name")
    return files


def _is_compressed(source: Path) -> bool:
    information = read_metadata(source) or {}
    return str(information.get("compression_mode") or "").lower() not in ("", "none")


def _miscounts(source: Path) -> list[str]:
    """What `metadata.yaml` of a folder that can be read says otherwise than its files."""
    try:
        storage = open_storage(source)
    except BagError:
        return []
    with ExitStack() as stack:
        stack.callback(storage.close)
        return doubts(read_metadata(source) or {}, storage.topics())


def _save(source: Path, files: list[Path], folder: Path) -> RecoveryReport:
    """Write what can be read into one new recording."""
    report = RecoveryReport(folder)
    if files[0].suffix == ".mcap" and not _is_compressed(source):
        with ExitStack() as stack:
            rewrite(source, [_opened(file, stack) for file in files], folder, report)
        return report
    if source.is_dir() and read_metadata(source) is not None:
        storage = open_storage(source)
    else:
        storage = open_files(source, files, {}, [], ExitStack())
    try:
        copy_messages(source, storage, folder, report)
    finally:
        storage.close()
    return report


def _opened(path: Path, stack: ExitStack) -> McapFile:
    file = McapFile(path)
    stack.callback(file.close)
    return file


def _mend(source: Path, paths: list[Path]) -> RecoveryReport:
    """Rewrite the files that are torn, and give the folder its `metadata.yaml`."""
    report = RecoveryReport(source)
    with ExitStack() as stack:
        files = [_opened(path, stack) for path in paths]
        for file in files:
            shutil.rmtree(_workplace(file.path), ignore_errors=True)  # of a recovery that was interrupted
            damage = damage_of(file)
            if damage:
                raise BagError(f"{source}: {file.path.name}: {damage}; name an output to save what can be read")
        for file in files:
            if not file.complete:
                _rewrite_in_place(source, file, report)
    return _reindex(source, paths, report)


def _workplace(file: Path) -> Path:
    return file.parent / f".{file.name}{_TEMPORARY_SUFFIX}"


def _rewrite_in_place(source: Path, file: McapFile, report: RecoveryReport) -> None:
    """Write the finished file beside the torn one and put it in its place."""
    workplace = _workplace(file.path)
    try:
        rewrite(source, [file], workplace, report, file.path.name).replace(file.path)
        sync_folder(file.path.parent)
    except OSError as error:
        raise BagError(f"{source}: cannot replace the recording: {error.strerror}") from error
    finally:
        shutil.rmtree(workplace, ignore_errors=True)


def _reindex(source: Path, paths: list[Path], report: RecoveryReport) -> RecoveryReport:
    """Write `metadata.yaml` of a folder if it is missing or wrong; a file needs none."""
    with ExitStack() as stack:
        storage = open_files(source, paths, {}, [], stack) if not _is_compressed(source) else open_storage(source)
        stack.callback(storage.close)
        report.messages = {entry.topic.name: entry.count for entry in storage.topics()}
        report.notes += storage.notes
        wrong = _wrong_metadata(source, paths, storage) if source.is_dir() else []
        if wrong and _is_compressed(source):
            raise BagError(f"{source}: {wrong[0]}; name an output to save what can be read")
        report.was_complete = not wrong and not report.rewritten
        if wrong:
            report.notes += [f"{reason}; written anew" for reason in wrong]
        if wrong or (report.rewritten and source.is_dir()):
            _write_metadata(source, metadata_text(_information(source, paths, storage)))
    return report


def _write_metadata(source: Path, text: str) -> None:
    try:
        write_atomically(source / METADATA_FILE, text)
    except OSError as error:
        raise BagError(
            f"{source}: cannot write {METADATA_FILE}: {error.strerror}; make room, or name an output on another disk"
        ) from error


def _named(source: Path) -> list[str]:
    return named_files(read_metadata(source) or {"relative_file_paths": []})


def _wrong_metadata(source: Path, paths: list[Path], storage: BagStorage) -> list[str]:
    information = read_metadata(source)
    if information is None:
        return [f"{METADATA_FILE} was missing or could not be read"]
    found = [f"{METADATA_FILE} named {name}, which is not there" for name in _gone(source, paths)]
    new = [path.name for path in paths if path.name not in named_files(information)]
    found += [f"{METADATA_FILE} did not name {name}" for name in new]
    return found + doubts(information, storage.topics())


def _gone(source: Path, paths: list[Path]) -> list[str]:
    """Files that `metadata.yaml` names and that are not there."""
    information = read_metadata(source)
    names = {path.name for path in paths}
    return [name for name in named_files(information) if name not in names] if information else []


def _information(source: Path, paths: list[Path], storage: BagStorage) -> dict[str, object]:
    """Contents of a new `metadata.yaml`."""
    summaries = []
    for path in paths:
        with ExitStack() as stack:
            file = open_files(path, [path], {}, [], stack)
            summaries.append(FileSummary(path.name, *file.time_span(), sum(entry.count for entry in file.topics())))
    entries = storage.topics()
    hashes = [entry.topic.schema.type_hash if entry.topic.schema else "" for entry in entries]
    notes: dict[str, str] = {}
    losses: list[str] = [recovery_note(read_metadata(source) or {})]
    for values in (values for name, values in storage.metadata() if name == FLIGHT_RECORD):
        notes |= {key: value for key, value in values.items() if key != SEAL}
        losses.append(values.get(RECOVERY_NOTE, ""))
    if len(_gone(source, paths)) > len([path for path in paths if path.name not in _named(source)]):
        losses += [f"{name}, which was not there" for name in _gone(source, paths)]
    losses = list(dict.fromkeys(filter(None, losses)))
    if losses:
        notes[RECOVERY_NOTE] = "; ".join(losses)
    kind = "sqlite3" if paths[0].suffix == ".db3" else "mcap"
    summary = BagSummary(summaries, [entry.count for entry in entries], ros_distro(), notes, kind)
    return bag_information([entry.topic for entry in entries], hashes, summary)
