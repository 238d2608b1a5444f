"""Pages of the site: markdown of the repository from where it is, and the API from the docstrings.

A page keeps its path in the repository as its name, so every link between files holds in the site as it does in an editor.
What a page links to and is no page, such as a scenario, becomes a file of the site. ``mkdocs.yml`` names these hooks.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from plotly.offline import get_plotlyjs

ROOT = Path(__file__).resolve().parents[3]
PAGES = ("*.md", "docs/*.md", "docs/tools/*.md", "docs/site/**/*.md", "fmus/*/README.md")
PACKAGES = (
    "models/gossamer_models",
    "models/gossamer_models/*",
    "fmus/gossamer_fmus",
    "orchestrator/gossamer",
    "orchestrator/gossamer_orchestrator",
)
# The docstring of a package stands below its title, without what it contains.
ALONE = "    options: {members: false, show_root_heading: false, show_root_toc_entry: false}\n"
LINK = re.compile(r"\[([^\]]*)\]\(([^)#:\s]+)(?:#[\w-]+)?\)")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


def pages() -> list[str]:
    """Return the paths of all markdown pages, relative to the repository."""
    return sorted({file.relative_to(ROOT).as_posix() for pattern in PAGES for file in ROOT.glob(pattern)})


def public_names(package: Path) -> list[str]:
    """Return ``__all__`` of a package, or the names that its stub imports; nothing for one without public names."""
    stub = package / "__init__.pyi"
    if stub.exists():
        lines = ast.parse(stub.read_text(encoding="utf-8")).body
        return [each.asname or each.name for line in lines if isinstance(line, ast.ImportFrom) for each in line.names]
    source = package / "__init__.py"
    for line in ast.parse(source.read_text(encoding="utf-8")).body if source.exists() else ():
        if isinstance(line, ast.Assign) and isinstance(line.targets[0], ast.Name) and line.targets[0].id == "__all__":
            return list(ast.literal_eval(line.value))
    return []


def api() -> dict[str, str]:
    """Return a page of markdown for each package with public names, by its dotted name."""
    found = {}
    for package in sorted(folder for pattern in PACKAGES for folder in ROOT.glob(pattern)):
        names = public_names(package)
        if names:
            dotted = ".".join(package.relative_to(ROOT).parts[1:])
            found[dotted] = f"# {dotted}\n\n::: {dotted}\n{ALONE}" + "".join(f"\n::: {dotted}.{name}\n" for name in names)
    return found


def _address(path: str) -> str:
    """Return where a file of the repository stands in the site: the start page takes the place of the README."""
    place = PurePosixPath(path.removeprefix("docs/site/"))
    if path == "README.md":
        return "guide.html"
    if place.name == "README.md":
        return str(place.with_name("index.html"))
    return str(place.with_suffix(".html") if place.suffix == ".md" else place)


def _linked(path: str) -> set[str]:
    """Return the paths of what a page links to and exists; a link without its file stays for MkDocs to refuse."""
    text = FENCE.sub("", (ROOT / path).read_text(encoding="utf-8"))
    targets = ((ROOT / path).parent / target for _, target in LINK.findall(text))
    return {each.resolve().relative_to(ROOT).as_posix() for each in targets if each.is_file()}


def on_config(config: MkDocsConfig) -> None:
    """Add to the contents what is in no list of ``mkdocs.yml``: the API, and new pages of ``docs``."""
    parts: dict[str, list[Any]] = {title: part for entry in config.nav or () for title, part in entry.items()}
    named = set(re.findall(r"[\w./]+\.md", str(config.nav)))
    parts["How to"] += [page for page in pages() if page not in named]
    parts["Reference"].append({"Python": [f"api/{name}.md" for name in api()]})


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Replace the files of ``docs/site`` by those of the whole repository that belong to the site."""
    for file in list(files):
        if file.src_dir == config.docs_dir:
            files.remove(file)
    assets = {file.relative_to(ROOT).as_posix() for file in (ROOT / "docs/site/assets").iterdir()}
    found = set(pages())
    for path in sorted(found.union(assets, *map(_linked, found))):
        files.append(File(path, str(ROOT), config.site_dir, use_directory_urls=False, dest_uri=_address(path)))
    for name, text in api().items():
        files.append(File.generated(config, f"api/{name}.md", content=text))
    motion = (ROOT / "docs/site/motion.json").read_text(encoding="utf-8")
    files.append(File.generated(config, "assets/motion.js", content=f"const motion = {motion};"))
    files.append(File.generated(config, "assets/plotly.min.js", content=get_plotlyjs()))
    return files


def on_page_markdown(markdown: str, *, page: Page, **_: object) -> str:
    """Write links to folders as plain text: a site without a server has no list of files to show."""
    folder = (ROOT / page.file.src_uri).parent

    def shown(link: re.Match[str]) -> str:
        return link[1] if (folder / link[2]).is_dir() else link[0]

    return LINK.sub(shown, markdown)
