"""The site is built without a warning; its links lead somewhere, it asks for no network, and it names all that is public."""

import json
import re
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[2]
# What a browser fetches on its own; it follows an `a` only when it is clicked.
FETCHED = {("script", "src"), ("img", "src"), ("iframe", "src"), ("source", "src"), ("link", "href")}
NO_FETCH = {"canonical", "next", "prev"}  # kinds of `link` that only state an address


class Page(HTMLParser):
    """Addresses that a page links to or fetches, its anchors, and its words outside of code."""

    def __init__(self, file):
        super().__init__()
        self.linked, self.fetched, self.anchors = [], [], set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.anchors |= {values[key] for key in ("id", "name") if values.get(key)}
        if tag == "a" and values.get("href"):
            self.linked.append(values["href"])
        for key in ("src", "href"):
            if (tag, key) in FETCHED and values.get(key) and values.get("rel") not in NO_FETCH:
                self.fetched.append(values[key])


@pytest.fixture(scope="module")
def pages(site):
    return {file: Page(file) for file in site.rglob("*.html") if file.name != "404.html"}


def test_every_link_leads_somewhere(site, pages):
    checked = 0
    for file, page in pages.items():
        for address in page.linked + [each for each in page.fetched if not each.startswith("data:")]:
            parts = urlsplit(address)
            if parts.scheme:
                assert parts.scheme in ("https", "mailto"), f"{file}: {address}"
                continue
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            assert target.is_relative_to(site), f"{file}: {address}"
            assert target.is_file(), f"{file}: {address}"
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].anchors | {"__comments"}, f"{file}: {address}"
            checked += 1
    assert checked > 1000


def test_no_page_asks_for_the_network(site, pages):
    for file, page in pages.items():
        for address in page.fetched:
            assert not urlsplit(address).netloc, f"{file}: {address}"
    for style in site.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import )['\"]?(?:https?:)?//", style.read_text(encoding="utf-8")), style


def test_every_page_of_the_repository_is_in_it(site):
    titles = {
        re.search(r"^# (.+)", file.read_text(encoding="utf-8"), re.MULTILINE)[1]: file
        for pattern in ("*.md", "docs/**/*.md", "fmus/*/README.md")
        for file in ROOT.glob(pattern)
    }
    built = [file.read_text(encoding="utf-8") for file in site.rglob("*.html")]
    headings = {re.search(r"<h1[^>]*>(.*?)(?:<a class|</h1>)", text, re.DOTALL)[1] for text in built}
    assert len(titles) > 30
    assert {re.sub(r"`", "", title) for title in titles} <= {re.sub(r"<[^>]+>", "", each) for each in headings}


def test_every_notebook_has_a_page_that_leads_to_it(site, pages):
    for notebook in (ROOT / "docs/notebooks").glob("*.ipynb"):
        page = pages[site / f"docs/notebooks/{notebook.stem}.html"]
        assert notebook.name in page.linked
        assert (site / f"docs/notebooks/{notebook.name}").read_bytes() == notebook.read_bytes()
        assert f"docs/notebooks/{notebook.stem}.html" in pages[site / "guide.html"].linked


def test_every_public_name_has_its_place(site, pages):
    packages = sorted(file.stem for file in (site / "api").glob("*.html"))
    assert {"gossamer_models", "gossamer_models.membrane", "gossamer_orchestrator", "gossamer_fmus"} <= set(packages)
    for package in packages:
        names = import_module(package).__all__
        assert names, package
        missing = {f"{package}.{name}" for name in names} - pages[site / "api" / f"{package}.html"].anchors
        assert not missing


def test_formulas_are_drawn(site):
    drawn = {}
    for file in site.rglob("*.html"):
        text = file.read_text(encoding="utf-8")
        drawn[file.relative_to(site).as_posix()] = text.count("<math")
        assert not re.search(r":math:|\.\. math::|\$<code>|language-math", text), file
    source = (ROOT / "fmus/detector/README.md").read_text(encoding="utf-8")
    assert drawn["fmus/detector/index.html"] == len(re.findall(r"\$`|^```math", source, re.MULTILINE)) > 20
    assert drawn["api/gossamer_models.sensor.html"] > 0


def test_the_membrane_of_the_start_page_is_that_of_the_model():
    from make_motion import MOTION, motion

    stored, again = json.loads(MOTION.read_text(encoding="utf-8")), motion(4)
    assert stored["w"][:4] == again["w"]
    assert max(map(max, again["w"])) > 100  # 10 mm
