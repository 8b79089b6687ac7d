# SPDX-License-Identifier: Apache-2.0
"""Text of strangers on screens: fuzzed as messages, as names and as what programs say.

TWINMILL_FUZZ_EXAMPLES sets how many texts are tried; see tests/fuzz/README.md.
"""

import io
import os
import time
import unicodedata

import pytest
import turbopi
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from rich.console import Group
from rich.table import Table
from rich.text import Text

from twinmill.data.log import read_log
from twinmill.foreign_text import LINE_MAX, plain_line, printable
from twinmill.robots.fleet import Fleet
from twinmill.robots.remote import _step_failure
from twinmill.terminal import Fitting, PlainConsole
from twinmill_cli.output import say
from twinmill_cli.swarm_screen import status_table
from twinmill_cli.swarm_verdict import Verdict

EXAMPLES = int(os.environ.get("TWINMILL_FUZZ_EXAMPLES", "50"))
fuzzed = settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
# Whatever rewrites a terminal, is markup, or turns a line round, mixed with all other characters.
PARTS = (
    "\x1b[2J", "\x1b]0;title\x07", "\x9b31m", "[red]", "[/red]", "[bold", "[link=x]", ":smile:",
    "\r", "\n", "\t", "\x00", "\x7f", "\x85", "\u2028", "\u202e", "\u200b", "\ufeff", "\ud800",
    "e\u0301", "\U0001f600", "{0}", "%s", "\\", "]",
)  # fmt: skip
texts = st.lists(st.sampled_from(PARTS) | st.text(max_size=20), max_size=12).map("".join)


def forbidden(text: str) -> list[str]:
    """Characters that no terminal may get from others (Unicode's classes of control and format)."""
    kinds = ("Cc", "Cf", "Cs", "Zl", "Zp")
    return [c for c in text if c != "\n" and unicodedata.category(c) in kinds]


@fuzzed
@given(texts)
@example("\x1b[31m" * 1000)
def test_a_line_is_one_printable_line_of_bounded_length(text):
    line = plain_line(text)
    assert not forbidden(line) and "\n" not in line and len(line) <= LINE_MAX
    assert plain_line(line) == line


@fuzzed
@given(st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=LINE_MAX))
def test_a_name_of_letters_is_left_as_it_is(text):
    assert plain_line(text) == printable(text) == text


class Bus:
    """Hands over messages as if they had come."""

    def subscribe(self, _, handler):
        self.hear = handler


def screen(width: int, *shown) -> str:
    file = io.StringIO()
    console = PlainConsole(file=file, width=width, color_system=None)
    console.print(*shown)
    return file.getvalue()


@fuzzed
@given(texts, texts, texts, texts, st.sampled_from([40, 80, 200]))
@example("[/red]", "[bold", "\x1b[2J", "", 80)
def test_messages_of_strangers_are_rows_of_a_table(source, version, behavior, reason, width):
    bus = Bus()
    fleet = Fleet("", connect=lambda _: bus)
    run, ack = turbopi.run_t(), turbopi.ack_t()
    run.source, run.version, run.behavior, ack.reason = (
        text.encode(errors="replace").decode() for text in (source, version, behavior, reason)
    )
    for kind, message in (("RUN", run), ("ACK", ack), ("TELEMETRY", turbopi.telemetry_t())):
        message.utime_us = int(time.time() * 1e6)  # what is older is no news of now
        bus.hear(f"R03_{kind}", message.encode())
    shown = screen(width, status_table([fleet.robots[3]]))
    assert not forbidden(shown)
    assert "R03" in shown and "stopped" in shown
    assert not forbidden(fleet.robots[3].acks[0].reason)


def letters(text: str) -> str:
    """Text less its blanks and the characters that may not be shown."""
    return "".join(c for c in text if c.isprintable() and not c.isspace()).replace("\ufffd", "")


@fuzzed
@given(texts)
@example("[/]")
@example("[link=file:///etc/passwd]here[/link] :smile:")
def test_whatever_is_printed_is_text_and_whole(text):
    """Strings, cells, titles and sentences: none is styled, lost or taken for a picture's name."""
    table = Table("name", title=text)
    table.add_row(text)
    for shown in (text, Text(text), Group(Fitting(table)), Verdict(True, text).sentence):
        drawn = screen(2000, shown)
        assert not forbidden(drawn)
        assert letters(text) in letters(drawn)


@fuzzed
@given(texts)
def test_what_a_robots_programs_say_is_one_line(text):
    for said in (text, f"failed: kind: {text}"):
        error = _step_failure(said)
        assert not forbidden(f"{error}{error.kind}") and "\n" not in str(error)


@fuzzed
@given(texts)
def test_sentences_on_stderr_are_one_line(capsys, text):
    say(text)
    said = capsys.readouterr().err
    assert not forbidden(said) and said.count("\n") == 1


@pytest.mark.parametrize("text", ["\x1b[2J\x1b[H", "a\nb\rc", "\u202etxt.exe"])
def test_a_failure_that_quotes_a_file_cannot_rewrite_the_terminal(twinmill, tmp_path, text):
    table = tmp_path / "poses.csv"
    table.write_text(f"{text},t_s\n1,2\n")
    code, out, err = twinmill("import", "--poses", table, "--commands", table, "-o", "x.lcmlog")
    assert code == 1 and not forbidden(out + err)


def test_a_name_that_no_output_can_hold_is_refused(twinmill, tmp_path):
    log = tmp_path / "run\udcff.lcmlog"
    log.touch()
    code, _, err = twinmill("compare", log, "--model", "turbopi.toml")
    assert code == 1 and "rename" in err and not forbidden(err)


def test_brackets_without_end_are_no_settings(write_log, message):
    """A parser that calls itself for each of them gives up."""
    run = message("run", utime_us=1, robot_id=3, config_toml="a = " + "[" * 20_000)
    told = message("telemetry", utime_us=2, robot_id=3)
    assert list(read_log(write_log(("R03_RUN", run), ("R03_TELEMETRY", told))).robots) == [3]
