r"""Formulas of pages and docstrings as MathML, which browsers draw without a script.

Pages write formulas as GitHub does, ``$`x`$`` and blocks of ``math``; docstrings as Sphinx does, ``:math:`x``` and
``.. math::``.
"""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert
from mkdocs.structure.pages import Page

INLINE = re.compile(r"(?:\$<code>(.*?)</code>\$)|(?::math:<code>(.*?)</code>)", re.DOTALL)
FENCED = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)
DIRECTIVE = re.compile(r"<p>\.\. math::\s*(.*?)</p>", re.DOTALL)
DIRECTIVE_ABOVE = re.compile(
    r'<p>\.\. math::</p>\s*<div class="highlight"><pre>.*?<code>(.*?)</code></pre></div>', re.DOTALL
)
REFERENCE = re.compile(r"\.\. (\[\d+\])")
CITATION = re.compile(r"(\[\d+\])_(?!\w)")
TAG = re.compile(r"<[^>]+>")


def _formula(text: str, display: str) -> str:
    source = html.unescape(TAG.sub("", text)).strip()
    return convert(source, display=display)


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace blocks of ``math`` before they count as code."""
    return FENCED.sub(lambda found: "\n" + convert(" ".join(found[1].split()), display="block") + "\n", markdown)


def on_page_content(content: str, *, page: Page, **_: object) -> str:
    """Replace the other formulas of a page, and in docstrings Sphinx' marks of references."""
    content = DIRECTIVE_ABOVE.sub(lambda found: _formula(found[1], "block"), content)
    content = DIRECTIVE.sub(lambda found: _formula(found[1], "block"), content)
    content = INLINE.sub(lambda found: _formula(found[1] or found[2], "inline"), content)
    if page.file.src_uri.startswith("api/"):
        content = CITATION.sub(r"\1", REFERENCE.sub(r"<br>\1", content))
    return content
