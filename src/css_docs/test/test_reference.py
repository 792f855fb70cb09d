# SPDX-License-Identifier: Apache-2.0
"""Whatever there is has its page: verbs, nodes, messages, mission keys, kernels; and pages name nothing that is not."""

from pathlib import Path, PurePosixPath
from typing import Any

import pytest

from css_common.shared_sections import shared_parameters
from css_docs import algorithm_pages
from css_docs.figure_files import figure_names
from css_docs.made_pages import made_pages
from css_docs.reference import messages, node_pages
from css_docs.reference.verbs import help_of, table_of_verbs
from css_docs.staging import Stage

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def made():
    return made_pages(ROOT)


def page(made, *parts):
    return made[PurePosixPath("reference", *parts)]


def test_every_verb_has_its_page_with_its_own_help(made):
    verbs = table_of_verbs(ROOT).VERBS
    assert {"fly", "docs", "completion", "shell"} <= verbs.keys()
    for name in verbs:
        assert help_of(ROOT, name).rstrip() in page(made, "verbs", f"{name}.md")
        assert f"({name}.md)" in page(made, "verbs", "index.md")
    assert "| 130 | interrupted |" in page(made, "verbs", "index.md")


def test_every_node_file_has_its_page(made):
    files = {file for file in ROOT.glob("src/*/*/nodes/[a-z]*.py")}
    assert len(files) > 20
    for file in files:
        assert page(made, "nodes", file.parts[-3], f"{file.stem}.md").startswith(f"# {file.parts[-3]} {file.stem}\n")


def test_every_parameter_stands_on_the_page_of_its_node_or_among_the_mission_keys(made):
    shared, keys = shared_parameters(), page(made, "mission_keys.md")
    for (package, name), kind in node_pages.components(ROOT).items():
        own = page(made, "nodes", package, f"{name}.md")
        for parameter in kind.table():
            assert f"| `{parameter.name}`" in (keys if parameter.name in shared else own), (name, parameter.name)
        ports: list[Any] = [*kind.inputs(name, _values(kind)), *kind.outputs(name, _values(kind))]
        for topic in [port.topic for port in ports]:
            assert f"| `{topic}` |" in own


def _values(kind):
    from css_common.schema import default_values

    return default_values(kind.table())


def test_every_shared_key_is_among_the_mission_keys(made):
    for name in shared_parameters():
        assert f"| `{name}`" in page(made, "mission_keys.md"), name
    for script in ("extends", "events", "faults", "dispersions", "criteria"):
        assert f"\n## {script}\n" in page(made, "mission_keys.md")


def test_every_message_has_its_page_with_every_field_and_unit(made):
    files = [*ROOT.glob("src/css_msgs/msg/*.msg"), *ROOT.glob("src/css_msgs/srv/*.srv")]
    assert len(files) > 14
    for file in files:
        assert PurePosixPath("reference", "messages", f"{file.stem}.md") in made
    (sun,) = [i for i in messages.interfaces(ROOT) if i.name == "SunEstimate"]
    fields = {field.name: field for field in sun.parts[0]}
    assert fields["omega_bn_b"][:4] == ("float64[3]", "omega_bn_b", "", "rad/s")
    assert fields["VALIDITY_HELD"].value == "1" and fields["VALIDITY_HELD"].meaning.startswith("no cell sees the Sun")
    assert "`age` | `float64` | s |" in page(made, "messages", "SunEstimate.md")


def test_every_mission_that_comes_with_the_project_is_listed(made):
    for file in ROOT.glob("config/*.yaml"):
        assert f"\n## {file.stem}\n" in page(made, "missions.md")


def test_every_kernel_is_told_of_on_a_page_of_an_algorithm():
    kernels = algorithm_pages.kernel_modules(ROOT)
    assert len(kernels) > 100
    pages = algorithm_pages.algorithm_pages(ROOT)
    told = {name for p in pages for name in algorithm_pages.modules_of(p, kernels)}
    assert sorted(set(kernels) - told) == [], "a page of docs/algorithms says in its first lines what it is about"


def test_every_node_that_flies_is_told_of_on_a_page_of_an_algorithm():
    told = algorithm_pages.runs(ROOT)
    flown = {f"{package}/{name}" for package, name in node_pages.components(ROOT)}
    # drivers and what only draws have no algorithm: they are on pages of their own
    free = {node for node in flown if node.startswith("css_drivers/") or node.endswith("/visualizer")}
    assert sorted(flown - free - told.keys()) == []
    assert told.keys() <= flown


def test_pages_of_algorithms_name_what_there_is():
    modules, figures = algorithm_pages.all_modules(ROOT), figure_names()
    used: list[str] = []
    for p in algorithm_pages.algorithm_pages(ROOT):
        for pattern in p.patterns:
            one = algorithm_pages.AlgorithmPage(p.page, p.title, (pattern,), (), ())
            assert algorithm_pages.modules_of(one, modules), (p.page, pattern)
        assert p.figures and set(p.figures) <= set(figures), p.page
        used += p.figures
        text = (ROOT / "docs" / p.page).read_text(encoding="utf-8")
        for word in ("$$", "\nSource:", "\nAssumes", "\nFails"):
            assert word in text, (p.page, word)
    assert sorted(used) == figures


def test_a_link_that_leads_nowhere_is_refused(tmp_path):
    from css_docs.errors import DocsError

    stage = Stage(ROOT, tmp_path)
    with pytest.raises(DocsError, match=r"src/nowhere\.py in made"):
        stage.lay_out({PurePosixPath("x.md"): "[here](repo:src/nowhere.py)"}, {})
