"""Read a page of results as its file: tags, what stands in them, and the packed data."""

from __future__ import annotations

import base64
import gzip
import json
from html.parser import HTMLParser

import numpy as np

VOID = {"meta", "input", "link", "br", "img", "hr"}


class Reader(HTMLParser):
    """Tags of a page that closes what it opens."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open, self.tags, self.inside = [], [], {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append((tag, dict(attrs).get("id")))

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, text):
        for _, name in self.open:
            self.inside[name] = self.inside.get(name, "") + with_spaces(text)

    def unpacked(self, name):
        return gzip.decompress(base64.b64decode(self.inside[name])).decode()


def with_spaces(text):
    """Return text with a space for each no-break space, as it is typed."""
    return text.replace("\N{NO-BREAK SPACE}", " ")


def content_of(text):
    """Read the data of a page; arrays that stand again are the same."""
    known = []

    def resolved(each):
        if "same" in each:
            return known[each["same"]]
        if {"bytes", "shape"} <= each.keys():
            known.append(each)
        return each

    return json.loads(text, object_hook=resolved)


def numbers(packed):
    return np.frombuffer(base64.b64decode(packed["bytes"]), f"<{packed['kind']}").reshape(packed["shape"])


def read_page(path):
    """Check that a page is one whole file that asks for nothing from outside; return it and the charts on it by title."""
    text = path.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    page = Reader(text)
    for _, attributes in page.tags:
        assert "src" not in attributes
        assert not attributes.get("href", "#").startswith("http")
    charts = content_of(with_spaces(page.unpacked("data")).replace("\\u00a0", " "))["charts"]
    return page, {chart["title"]: chart for chart in charts}


def values(packed):
    """Return numbers of a chart, packed or not."""
    return numbers(packed).tolist() if isinstance(packed, dict) else packed
