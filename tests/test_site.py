# SPDX-License-Identifier: Apache-2.0
"""The site of `./sunpoint docs`: its pages are right, what is wrong with one is found, it works without a network."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from listing import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

from browser import NAMES, Browser, browser_path
from page_checks import WIDTHS

_FETCHED = ("http:", "https:", "ws:")


def docs(*arguments: str, home: Path | None = None) -> subprocess.CompletedProcess[str]:
    """`./sunpoint docs`, or with a home the executable in another checkout."""
    env = {name: value for name, value in os.environ.items() if name != "SUNPOINT_VERB"}
    command = [str(ROOT / "sunpoint"), "docs"]
    if home is not None:
        extra = str(ROOT / ".venv" / "extra" / "docs")
        env |= {"SUNPOINT_HOME": str(home), "PYTHONPATH": os.pathsep.join((extra, env.get("PYTHONPATH", "")))}
        command = [str(ROOT / "install" / "css_docs" / "lib" / "css_docs" / "docs")]
    return subprocess.run([*command, *arguments], capture_output=True, text=True, env=env, timeout=3000, check=False)


@pytest.fixture(scope="module")
def checked():
    """All pages read; the start has installed what that needs."""
    return docs("--check")


def test_nothing_is_wrong_with_any_page(checked):
    assert (checked.returncode, checked.stdout.startswith("nothing is wrong with")) == (0, True), checked.stderr


@pytest.mark.usefixtures("checked")
def test_what_is_wrong_with_a_page_is_found_and_named(tmp_path):
    for linked in ("tools", "config"):
        (tmp_path / linked).symlink_to(ROOT / linked)
    for file in ROOT.glob("src/*/*"):
        if file.name != "README.md":  # whose links need all other pages
            (tmp_path / "src" / file.parent.name).mkdir(parents=True, exist_ok=True)
            (tmp_path / "src" / file.parent.name / file.name).symlink_to(file)
    (tmp_path / "docs" / "_static").mkdir(parents=True)
    shutil.copy(ROOT / "docs" / "conf.py", tmp_path / "docs")
    page = tmp_path / "docs" / "index.md"
    page.write_text("# Title\n\n[nowhere](#no-such-part)\n\n$\\nosuchcommand{x}$\n\n```{nosuch}\n```\n")
    done = docs("--check", home=tmp_path)
    assert done.returncode == 1, done.stderr
    for told in ("no-such-part", r"\nosuchcommand is not known", "nosuch", "isn't included in any toctree"):
        assert told in done.stderr
    assert "Traceback" not in done.stderr
    page.write_text("# Title\n\n[nowhere](nowhere.md)\n")
    done = docs("--check", home=tmp_path)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (
        2, "docs: error: links that lead nowhere: nowhere.md in docs/index.md",
    )  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The whole of it, with figures."""
    folder = tmp_path_factory.mktemp("site")
    done = docs("-o", str(folder), "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["index"] == str(folder / "index.html") and told["figures"] > 20
    return folder


BROWSER = browser_path() or ""
with_browser = pytest.mark.skipif(not BROWSER, reason=f"no browser on this machine, looked for {', '.join(NAMES)}")


@pytest.mark.timeout(3000)
class TestWhole:
    """What takes minutes to build."""

    def test_no_page_names_what_is_not_there_or_elsewhere(self, site):
        pages = list(site.rglob("*.html"))
        assert len(pages) > 100
        for page in pages:
            text = page.read_text(encoding="utf-8")
            for mark in (' src="http', ' href="http', "@import url(http"):
                for part in text.split(mark)[1:]:
                    # links to read on elsewhere are no part of the page
                    assert mark == ' href="http' and "stylesheet" not in part[:200], (page, part[:100])

    @with_browser
    def test_search_finds_without_a_network(self, site):
        with Browser(BROWSER, 1400) as browser:
            browser.open(site / "search.html")
            found = browser.evaluate(
                "(async () => { Search.performSearch('least_norm') ; Search.performSearch('coning');"
                "for (let i = 0; i < 200 && !document.querySelector('#search-results li a'); i++)"
                "await new Promise((done) => setTimeout(done, 50));"
                "return [...document.querySelectorAll('#search-results li a')].map((a) => a.getAttribute('href')); })()"
            )
            assert any("algorithms/coning" in link for link in found), found
            assert not [url for url in browser.requests if url.startswith(_FETCHED)]
            assert browser.complaints == []

    @with_browser
    @pytest.mark.parametrize("width", WIDTHS)
    def test_equations_tables_and_figures_are_shown(self, site, width):
        with Browser(BROWSER, width) as browser:
            for name in ("index", "algorithms/sunline_ekf", "reference/nodes/css_estimation/sun_filter"):
                browser.open(site / f"{name}.html")
                wide = browser.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
                assert wide <= 1, (name, width)
                assert browser.complaints == [] and not [u for u in browser.requests if u.startswith(_FETCHED)]
            browser.open(site / "algorithms" / "sunline_ekf.html")
            sizes = browser.evaluate(
                "[...document.querySelectorAll('article math, article figure img')].map((e) => "
                "[e.tagName, e.getBoundingClientRect().width, e.getBoundingClientRect().height, e.naturalWidth ?? 1])"
            )
            assert {"math", "IMG"} <= {kind for kind, *_ in sizes}
            assert all(w > 3 and h > 3 and natural > 0 for _, w, h, natural in sizes)
