# SPDX-License-Identifier: Apache-2.0
"""Text of strangers in pages: fuzzed; TWINMILL_FUZZ_EXAMPLES sets how many texts are tried."""

import json
import os
from html.parser import HTMLParser

from hypothesis import example, given, settings
from hypothesis import strategies as st

from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.workbench.panel import commands_html, escaped
from twinmill.workbench.screen import _in_script

EXAMPLES = int(os.environ.get("TWINMILL_FUZZ_EXAMPLES", "100"))
FOREIGN = '<img src=x onerror="window.owned=1"><script>window.owned=1</script>'


class Seen(HTMLParser):
    """Tags and text, as a browser finds them."""

    def __init__(self, text: str):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)

    def handle_data(self, data):
        self.text += data


@settings(max_examples=EXAMPLES, deadline=None)
@given(st.lists(st.text() | st.sampled_from(["<", ">", '"', "'", "&lt;", "<b", "{}"])).map("".join))
@example(FOREIGN)
def test_texts_are_texts_in_pages(text):
    seen = Seen(escaped('<b title="{}">{}</b>', text, text))
    assert seen.tags == ["b"]
    assert seen.text == plain_line(text, MESSAGE_MAX)
    assert set(Seen(commands_html([text])).tags) == {"pre", "span"}


@given(st.dictionaries(st.text(), st.text()))
@example({"behavior": "</script><script>window.owned=1</script>"})
def test_a_text_ends_no_script(value):
    assert "<" not in _in_script(value)
    assert json.loads(_in_script(value)) == value
