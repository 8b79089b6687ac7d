# SPDX-License-Identifier: Apache-2.0
"""Text of strangers in pages: fuzzed; TWINMILL_FUZZ_EXAMPLES sets how many texts are tried."""

import json
import os
from html.parser import HTMLParser

from hypothesis import example, given, settings
from hypothesis import strategies as st

from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.report import Figure, Provenance, Section, render_page
from twinmill.report.tables import Cell, Table
from twinmill.workbench.panel import commands_html, escaped
from twinmill.workbench.screen import _in_script

EXAMPLES = int(os.environ.get("TWINMILL_FUZZ_EXAMPLES", "100"))
FOREIGN = '<img src=x onerror="window.owned=1"><script>window.owned=1</script>'


class Seen(HTMLParser):
    """Tags and text, as a browser finds them."""

    def __init__(self, text: str):
        super().__init__()
        self.tags, self.attributes, self.text = [], set(), ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes |= dict(attributes).keys()

    def handle_data(self, data):
        self.text += data


PARTS = ("<", ">", '"', "'", "&lt;", "<b", "{}", "`", "</title>", "</style>", "\u202e", "\udcff")
texts = st.lists(st.text() | st.sampled_from(PARTS)).map("".join)
fuzzed = settings(max_examples=EXAMPLES, deadline=None)


@fuzzed
@given(texts)
@example(FOREIGN)
def test_texts_are_texts_in_pages(text):
    seen = Seen(escaped('<b title="{}">{}</b>', text, text))
    assert seen.tags == ["b"]
    assert seen.text == plain_line(text, MESSAGE_MAX)
    assert set(Seen(commands_html([text])).tags) == {"pre", "span"}


def report_page(text: str) -> Seen:
    """A report that has a text wherever one can be."""
    table = Table(text, [text], [[Cell(text)]], note=text)
    section = Section(
        text, [(text, text, "good")], text, [(text, text)], [Figure("<svg/>", text, text)], [table],
        next_step=text, commands=[(text, text)], transcript=[(text, text)], notes=[text],
        warnings=[text], folded=[table],
    )  # fmt: skip
    return Seen(render_page(text, Provenance(text, text, text), [section, section], text))


def fixed(page: Seen) -> list[str]:
    """Its elements, without those of lines, and of commands between back quotes."""
    return [tag for tag in page.tags if tag not in ("p", "code")]


@fuzzed
@given(texts.map(lambda text: f"x{text}"))
@example(f"x{FOREIGN}")
def test_texts_add_nothing_but_text_to_reports(text):
    page, plain = report_page(text), report_page("x")
    assert (fixed(page), page.attributes) == (fixed(plain), plain.attributes)
    assert page.text.replace("\n", "").isprintable()


@fuzzed
@given(st.dictionaries(st.text(), st.text()))
@example({"behavior": "</script><script>window.owned=1</script>"})
def test_a_text_ends_no_script(value):
    assert "<" not in _in_script(value)
    assert json.loads(_in_script(value)) == value
