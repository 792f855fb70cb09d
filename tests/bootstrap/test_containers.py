# SPDX-License-Identifier: Apache-2.0
"""The container files agree with each other and with what a first start asks a machine for."""

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")


def test_the_image_has_what_the_start_refuses_to_go_without():
    assert {"g++", "python3", "python3-dev", "python3-venv"} <= set(re.findall(r"[\w+-]+", DOCKERFILE))


def test_the_editor_opens_a_stage_of_the_image_as_its_user():
    file = ROOT / ".devcontainer" / "devcontainer.json"
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("//")]
    told = json.loads("\n".join(lines))
    build = told["build"]
    assert (file.parent / build["dockerfile"]).resolve() == ROOT / "Dockerfile"
    assert (file.parent / build["context"]).resolve() == ROOT
    assert f" AS {build['target']}\n" in DOCKERFILE
    assert re.search(rf"useradd .* {told['remoteUser']} ", DOCKERFILE)


def test_nothing_that_a_start_makes_goes_into_the_image():
    ignored = set((ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines())
    made = re.findall(r"^/([\w.]+)/$", (ROOT / ".gitignore").read_text(encoding="utf-8"), re.MULTILINE)
    assert {".venv", "build", "install", "log"} <= set(made) <= ignored
