"""Cross-references of docstrings (``:class:`~a.b.C```) as links, the last name as their text."""

import re

ROLE = re.compile(r":(?:class|func|meth|mod|attr|data):<code>(~?)([\w.]+)</code>")


def on_page_content(html: str, **_: object) -> str:
    """Called by MkDocs with the HTML of each page."""

    def link(match: re.Match[str]) -> str:
        short, name = match.groups()
        text = name.rpartition(".")[2] if short else name
        return f'<autoref identifier="{name}" optional><code>{text}</code></autoref>'

    return ROLE.sub(link, html)
