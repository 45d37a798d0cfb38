"""Cross-references of docstrings as links, and a page for each example with its figures."""

import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROLE = re.compile(r":(?:class|func|meth|mod|attr|data):<code>(~?)([\w.]+)</code>")
FIGURE = re.compile(r'save_(figure|animation)\(.*?"(\w+)",?\s*(?:period=[\d.]+,?\s*)?\)', re.DOTALL)
SUFFIX = {"figure": "png", "animation": "gif"}
ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "build" / "examples"
CHAPTERS = {
    "ch01": "1 Introduction",
    "ch02": "2 Robots",
    "ch03": "3 Pick and place",
    "ch04": "4 Geometric perception",
}


def on_page_content(html: str, **_: object) -> str:
    """Called by MkDocs with the HTML of each page: ``:class:`~a.b.C``` shows the last name."""

    def link(match: re.Match[str]) -> str:
        short, name = match.groups()
        text = name.rpartition(".")[2] if short else name
        return f'<autoref identifier="{name}" optional><code>{text}</code></autoref>'

    return ROLE.sub(link, html)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Adds the examples to the navigation, chapter by chapter."""
    pages: dict[str, list[Any]] = {}
    for path in sorted((ROOT / "examples").glob("*.py")):
        chapter = CHAPTERS[path.stem[:4]]
        pages.setdefault(chapter, []).append({_title(path): f"examples/{path.stem}.md"})
    assert config.nav is not None
    examples = [{"Examples": [{chapter: entries} for chapter, entries in pages.items()]}]
    config.nav = [*config.nav[:-1], *examples, config.nav[-1]]
    return config


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Makes a page of each example, with its figures below the cells that draw them."""
    for path in sorted((ROOT / "examples").glob("*.py")):
        page = File.generated(config, f"examples/{path.stem}.md", content=_page(path))
        files.append(page)
        for picture in sorted((FIGURES / path.stem).glob("*.*")):
            uri = f"examples/{path.stem}/{picture.name}"
            files.append(File.generated(config, uri, abs_src_path=str(picture)))
    return files


def _title(path: Path) -> str:
    return path.read_text().splitlines()[1].removeprefix("# # ")


def _formula(match: re.Match[str]) -> str:
    display = "block" if match.group().startswith("$$") else "inline"
    return convert(match.group(1).strip(), display=display)


def _page(path: Path) -> str:
    """An example in percent format as Markdown."""
    out = []
    for cell in re.split(r"^# %%", path.read_text(), flags=re.MULTILINE)[1:]:
        head, _, body = cell.partition("\n")
        if "[markdown]" in head:
            text = re.sub(r"^# ?", "", body.strip(), flags=re.MULTILINE)
            # Browsers draw MathML by themselves; no script is to be fetched from anywhere.
            text = re.sub(r"\$\$(.+?)\$\$", _formula, text, flags=re.DOTALL)
            out.append(re.sub(r"\$(.+?)\$", _formula, text, flags=re.DOTALL))
            continue
        out.append(f"```python\n{body.strip()}\n```")
        for kind, name in FIGURE.findall(body):
            out.append(f"![{name.replace('_', ' ')}]({path.stem}/{name}.{SUFFIX[kind]})")
    out.append(f"*The file is `examples/{path.name}`; `.venv/bin/python` runs it.*")
    return "\n\n".join(out)
