"""Notebooks as pages: their text, their code, and what they showed when ``make site`` ran them.

A notebook is kept without outputs. Where no copy was run, as in the tests, its page has text and code alone and says so.
"""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[3]
FOLDER = ROOT / "docs/notebooks"
RUN = FOLDER / "out"  # copies that were run
LINK = re.compile(r"(\]\([\w./-]+)\.ipynb\)")
KEPT_AS = "This page is [{name}]({name}), which you can open in Jupyter or in an editor.{more}"
TAG = re.compile(r"<[^>]*>")
NOT_RUN = " It was not run for this site: `make site` runs it and shows what it prints and draws."


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for each notebook, beside the notebook itself."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        name = f"docs/notebooks/{path.stem}.md"
        ran = RUN / path.name
        text = page(nbformat.read(ran if ran.is_file() else path, as_version=4), path.name, run=ran.is_file())
        files.append(File.generated(config, name, content=text))
        if files.get_file_from_path(f"docs/notebooks/{path.name}") is None:
            files.append(File(f"docs/notebooks/{path.name}", str(ROOT), config.site_dir, use_directory_urls=False))
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: object) -> str:  # noqa: ANN401
    """Let links to a notebook lead to its page; the page itself links to the file."""
    return markdown if page.file.src_uri.startswith("docs/notebooks/") else LINK.sub(r"\1.md)", markdown)


def page(notebook: Any, name: str, *, run: bool) -> str:  # noqa: ANN401
    """Return a notebook as markdown.

    Parameters
    ----------
    notebook : nbformat.NotebookNode
        Text, code and outputs.
    name : str
        Its file.
    run : bool
        Whether it was run.
    """
    first, *cells = notebook.cells
    parts = [first.source, KEPT_AS.format(name=name, more="" if run else NOT_RUN)]
    for cell in cells if first.cell_type == "markdown" else notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
        else:
            parts.append(f"```python\n{cell.source}\n```")
            parts += [shown for each in cell.outputs if (shown := _shown(each))]
    return "\n\n".join(parts).replace('</pre></div>\n\n<div class="output"><pre>', "\n") + "\n"  # one after another


def _shown(output: Any) -> str:  # noqa: ANN401
    """Return what a cell shows, as HTML; nothing for progress and messages."""
    if output.output_type == "stream":
        return _framed(_text(output.text)) if output.name == "stdout" else ""
    data = output.get("data", {})
    if any("widget" in kind for kind in data):
        return ""
    if "image/png" in data:
        return _framed(f'<img alt="What the code above draws" src="data:image/png;base64,{data["image/png"].strip()}">')
    html, text = data.get("text/html", ""), data.get("text/plain", "")
    if html and "class=" not in html:  # what needs Jupyter's style sheets is shown as text
        return _framed(html) if "<img" in html or TAG.sub("", html).strip() else ""
    return _framed(_text(text)) if text else ""


def _framed(html: str) -> str:
    return f'<div class="output">{html}</div>'


def _text(text: str) -> str:
    return f"<pre>{escape(text.rstrip())}</pre>"
