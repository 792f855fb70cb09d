# SPDX-License-Identifier: Apache-2.0
"""The folder that Sphinx reads: pages of the repository, pages made from the code, and whatever they link."""

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from css_docs import links
from css_docs.errors import DocsError
from css_docs.pages import SOURCE, page_of, written_pages

REPOSITORY = "repo:"
"""Before the target of a link in a page that is made: a path in the repository."""

_LANGUAGES = {
    ".py": "python", ".yaml": "yaml", ".yml": "yaml", ".sh": "bash", ".c": "c", ".h": "c", ".toml": "toml",
    ".xml": "xml",
}  # fmt: skip
_PICTURES = {".png", ".svg", ".jpg"}
_FENCES = {"mermaid": "text", "sh": "bash", "": "text"}


class Stage:
    """Writes the source of the site; files that have not changed are left alone, so that few are read anew."""

    def __init__(self, root: Path, folder: Path, show_sources: bool = True) -> None:
        """Begins to lay out.

        Args:
            root: the repository.
            folder: what Sphinx will read.
            show_sources: files of the repository that are linked are shown; else their pages are empty.
        """
        self._root, self._folder = root, folder
        self._written = written_pages(root)
        self._show_sources = show_sources
        self._kept: set[Path] = set()
        self._sources: set[PurePosixPath] = set()
        self._wrong: list[str] = []

    @property
    def pages(self) -> int:
        """How many pages there are."""
        return sum(path.suffix == ".md" for path in self._kept)

    def lay_out(self, made: Mapping[PurePosixPath, str], added: Mapping[PurePosixPath, str]) -> None:
        """All pages and all files that they link; what an earlier build had and this one has not is removed.

        Args:
            made: pages that are made from the code, by their path in the site. In their links `repo:` stands before
                paths in the repository.
            added: text for the end of pages that are written by hand, by their path in the site.

        Raises:
            DocsError: links that lead nowhere.
        """
        site = {*made, *self._written.values()}
        for path, page in self._written.items():
            text = (self._root / path).read_text(encoding="utf-8")
            text = links.relinked(_plain_fences(text), lambda target, _: self._linked(path, page, target, site))  # noqa: B023
            self._put(page, text + self._made(page, added.get(page, "")))
        for page, text in made.items():
            self._put(page, self._made(page, text))
        done: set[PurePosixPath] = set()
        while waiting := self._sources - done:
            for path in sorted(waiting):
                self._put_source(path)
            done |= waiting
        self._remove_the_rest()
        if self._wrong:
            raise DocsError(f"links that lead nowhere: {'; '.join(self._wrong)}")

    def copy(self, source: Path, place: PurePosixPath) -> None:
        """A file of the site that is no page."""
        self._put(place, source.read_bytes())

    def _made(self, page: PurePosixPath, text: str) -> str:
        def convert(target: str, _: bool) -> str:
            if not target.startswith(REPOSITORY):
                return target
            return self._linked(PurePosixPath("made"), page, target.removeprefix(REPOSITORY), set())

        return links.relinked(text, convert)

    def _linked(self, path: PurePosixPath, page: PurePosixPath, target: str, site: set[PurePosixPath]) -> str:
        """The target of a link in a page of the site.

        Args:
            path: where the text of the page stands in the repository.
            page: where it stands in the site.
            site: pages that a link may name although they are not in the repository.
        """
        if links.is_outside(target):
            return target
        wanted, heading = links.resolved(path, target)
        if wanted in self._written:
            place = self._written[wanted]
        elif page_of(wanted) in site:
            place = page_of(wanted)
        elif wanted / "README.md" in self._written:
            place = self._written[wanted / "README.md"]
        elif not (self._root / wanted).exists() or ".." in wanted.parts:
            self._wrong.append(f"{target} in {path}")
            return target
        elif wanted.suffix in _PICTURES:
            place = PurePosixPath(SOURCE, wanted)
            self.copy(self._root / wanted, place)
        else:
            self._sources.add(wanted)
            place, heading = _source_page(self._root, wanted), ""
        return links.relative(page, place) + heading

    def _put_source(self, path: PurePosixPath) -> None:
        """A page that shows a file of the repository, or names those of a folder."""
        page = _source_page(self._root, path)
        file = self._root / path
        heading = f"---\norphan: true\nno-search: true\n---\n\n# {path}\n\n"
        if file.is_dir():
            inside = [p for p in sorted(file.iterdir()) if p.is_file() and not p.name.startswith((".", "__init__"))]
            self._sources |= {path / p.name for p in inside}
            places = {p.name: links.relative(page, _source_page(self._root, path / p.name)) for p in inside}
            self._put(page, heading + "".join(f"- [{name}]({place})\n" for name, place in places.items()))
            return
        if not self._show_sources:
            self._put(page, heading)
            return
        language = _LANGUAGES.get(path.suffix, "text")
        text = file.read_text(encoding="utf-8", errors="replace")
        self._put(page, f"{heading}````````{{code-block}} {language}\n:linenos:\n\n{text.rstrip()}\n````````\n")

    def _put(self, place: PurePosixPath, content: str | bytes) -> None:
        file = self._folder / place
        data = content.encode() if isinstance(content, str) else content
        self._kept.add(file)
        if not file.is_file() or file.read_bytes() != data:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)

    def _remove_the_rest(self) -> None:
        for file in sorted(self._folder.rglob("*"), reverse=True):
            if file.is_file() and file not in self._kept:
                file.unlink()
            elif file.is_dir() and not any(file.iterdir()):
                file.rmdir()


def _source_page(root: Path, path: PurePosixPath) -> PurePosixPath:
    folder = (root / path).is_dir()
    return PurePosixPath(SOURCE, path, "index.md") if folder else PurePosixPath(SOURCE, f"{path}.md")


def _plain_fences(text: str) -> str:
    """A page with the languages of its blocks as Sphinx names them."""
    lines, inside = [], False
    for line, is_code in links.lines_of(text):
        if is_code and not inside and line.strip().strip("`") in _FENCES:
            mark = line.rstrip()
            language = mark.strip().strip("`")
            line = f"{mark.removesuffix(language) if language else mark}{_FENCES[language]}\n"
        inside = is_code
        lines.append(line)
    return "".join(lines)
