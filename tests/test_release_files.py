# SPDX-License-Identifier: Apache-2.0
"""What others read of a release is what the code says: version, licence, references."""

import re
from pathlib import Path

import yaml
from presence import present

ROOT = Path(__file__).parents[1]


def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_citation_has_the_version_and_licence_of_the_packages():
    citation = yaml.safe_load(read("CITATION.cff"))
    manifest = read("src/css_common/package.xml")
    assert citation["version"] == present(re.search(r"<version>(.*?)</version>", manifest))[1]
    assert citation["license"] == present(re.search(r"<license>(.*?)</license>", manifest))[1]
    assert citation.keys() >= {"cff-version", "message", "title", "authors"}


def test_the_paper_cites_what_it_lists_and_lists_what_it_cites():
    cited = set(re.findall(r"\[@(\w+)\]", read("paper/paper.md")))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", read("paper/paper.bib"), re.M))


def test_issue_forms_ask_for_something():
    for file in sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")):
        form = yaml.safe_load(file.read_text(encoding="utf-8"))
        assert file.stem == "config" or all(part["attributes"]["label"] for part in form["body"])


def test_links_of_top_level_texts_lead_somewhere():
    for name in ("SECURITY.md", "CONTRIBUTING.md", "README.md", "docs/viewers.md"):
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", read(name)):
            assert ((ROOT / name).parent / target).exists(), f"{name} links to {target}"
