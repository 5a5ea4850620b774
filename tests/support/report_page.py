"""The tables and numbers of a report's page, as texts and the numbers behind them."""

from html.parser import HTMLParser

import pytest


class Page(HTMLParser):
    """Cells of all tables, the requirements that decide, and numbers in sentences.

    Cells are rows of texts and of the numbers behind them.  A requirement that decides is its value and the words after
    it.  A number in a sentence comes with the text before it, and with the number behind it.
    """

    def __init__(self):
        super().__init__()
        self.tables, self.keys, self.spans, self._texts = {}, [], [], None
        self._before, self._number, self._key, self.text = "", None, None, ""

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        if tag == "table":
            self._rows = self.tables.setdefault(attrs.get("id", f"table {len(self.tables)}"), [])
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("td", "th"):
            self._texts = []
            self._rows[-1].append((attrs.get("data-value"), self._texts))
        elif tag == "div" and attrs.get("class") == "key":
            self._texts = self._key = []
        elif tag == "span" and "data-value" in attrs:
            self._number = float(attrs["data-value"])

    def handle_endtag(self, tag):
        if tag == "div" and self._key is not None:
            value, *words = self._key
            self.keys.append((value, " ".join(" ".join(words).split())))
            self._key = None
        if tag in ("td", "th", "div"):
            self._texts = None

    def handle_data(self, data):
        self.text += data
        if self._texts is not None and data.strip():
            self._texts.append(data.strip())
        if self._number is not None:
            self.spans.append((self._before, self._number, data))
        self._before, self._number = data, None


def is_printed(printed, value):
    """Whether a number is printed: a text with at least two digits, rounded."""
    return float(printed) == pytest.approx(value, rel=0.05, abs=0.051 if "." in printed else 0.5)
