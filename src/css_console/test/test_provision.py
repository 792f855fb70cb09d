# SPDX-License-Identifier: Apache-2.0
"""What is fetched is what is pinned, or nothing is kept."""

import base64
import hashlib
import io
import tarfile

import pytest

from css_console import provision
from css_console.errors import ConsoleError
from css_console.provision import LIBRARIES, Library, fetched, provide


def registry(folder, monkeypatch, members):
    """A registry on this disk with one package; the library that it gives."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w:gz") as tar:
        for name, text in members.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(text)
            tar.addfile(entry, io.BytesIO(text))
    archive = packed.getvalue()
    place = folder / "registry" / "gadget" / "-"
    place.mkdir(parents=True)
    (place / "gadget-1.2.3.tgz").write_bytes(archive)
    monkeypatch.setenv("npm_config_registry", (folder / "registry").as_uri() + "/")
    monkeypatch.setattr(provision.places, "scratch", lambda name: folder / name)
    integrity = "sha512-" + base64.b64encode(hashlib.sha512(archive).digest()).decode()
    library = Library("gadget", "1.2.3", integrity, {"dist/gadget.js": "gadget.js"})
    monkeypatch.setattr(provision, "LIBRARIES", (library,))
    return library


def test_a_library_is_fetched_once_and_kept(tmp_path, monkeypatch):
    library = registry(tmp_path, monkeypatch, {"package/dist/gadget.js": b"one", "package/evil.js": b"two"})
    said: list[str] = []
    files = provide(said.append)
    assert files["gadget.js"].read_bytes() == b"one"
    assert [file.name for file in files["gadget.js"].parent.iterdir()] == ["gadget.js"]
    assert said == [f"fetching gadget 1.2.3 (needed once): {library.address}"]
    monkeypatch.setenv("npm_config_registry", "http://127.0.0.1:9")  # nobody is there
    assert provide(said.append) == files
    assert len(said) == 1


def test_another_archive_is_refused_and_nothing_is_kept(tmp_path, monkeypatch):
    library = registry(tmp_path, monkeypatch, {"package/dist/gadget.js": b"one"})
    monkeypatch.setattr(provision, "LIBRARIES", (library._replace(integrity="sha512-AAAA"),))
    with pytest.raises(ConsoleError, match="expected sha512-AAAA; nothing was kept"):
        provide(print)
    assert [file.name for file in (tmp_path / "console").iterdir()] == ["lock"]


def test_without_a_network_it_says_what_was_needed(monkeypatch):
    monkeypatch.setenv("npm_config_registry", "http://127.0.0.1:9")
    with pytest.raises(ConsoleError, match=r"http://127.0.0.1:9/three/-/three-[0-9.]+tgz: cannot be fetched"):
        fetched(LIBRARIES[0])
