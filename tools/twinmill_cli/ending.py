# SPDX-License-Identifier: Apache-2.0
"""How our programs end: an exit code; where they fail a sentence, and an object with --json."""

import difflib
import errno
import io
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable, Collection
from contextlib import suppress
from typing import Any, NoReturn

import typer

from twinmill.extras import LAB, MissingExtra, missing
from twinmill.foreign_text import MESSAGE_MAX, plain_line
from twinmill.streams import STDERR, STDOUT, closed_at_first, open_nowhere
from twinmill_cli import done, early
from twinmill_cli.exit_now import STOPPED, exit_now
from twinmill_cli.output import begin_telling, has_told, print_object, say
from twinmill_cli.word_order import GROUP, TO_ROBOTS, in_order, verb_of

WRONG_COMMAND_LINE = 2
LIKE_STOP = 0.75  # difflib's ratio of stpo, two letters of which are exchanged
QUOTED = 80  # letters of what a sentence quotes
HALTS = ("halt", "abort", "kill", "off")  # other words for it
NO_ROOM = {  # why a file takes no more, and what to do
    errno.ENOSPC: "no space is left there; make room",
    errno.EDQUOT: "your quota of that disk is used up; make room",
    errno.EFBIG: "no file may become so large here (ulimit -f); raise that",
}
OF_TABLES = ("import", "track", "track-calibrate", "track-check", "characterise")  # judge no log


class NotText(typer.TyperException):
    """Word of a command line that is no text, and no file's name."""

    exit_code = WRONG_COMMAND_LINE


def leave(
    program: str,
    run: Callable[[list[str]], Any],
    stopped: str = "",
    verbs: Collection[str] = (),
) -> NoReturn:
    """Runs a program's command line and leaves with its exit code.

    Args:
        program: its name.
        run: does what the words of the command line say; returns an exit code, if an int.
        stopped: what to say after Ctrl-C.
        verbs: words that may stand behind `swarm`, beside those to robots.
    """
    sys.excepthook = sys.__excepthook__  # all that every command needs is imported
    words = (in_order(sys.argv[1:]) if verbs else sys.argv[1:]) or ["--help"]
    try:
        _prepare()
        if not _is_stop(words):
            _check_encoding(words)
        result = run(words)
        code = result if isinstance(result, int) else 0
        _end_untouched()
    except KeyboardInterrupt:  # before the command, or after it
        if early.verb() in TO_ROBOTS and not done.is_decided():
            early.tell_end()
        code = done.decided_or(STOPPED)
    except Exception as error:
        code, sentence = _told(error)
        if sentence:
            sentence += _of_no_stop(words, verbs) if code == WRONG_COMMAND_LINE else ""
            sentence += _of_robots(error, sentence)
            done.decide(code)
            _say(sentence, program)
            _print_failure(sentence, error, words, verbs)
    if code == STOPPED and stopped:
        say(stopped, program)
    code = _written(program, code)
    if (code == STOPPED and words[0] == "swarm") or sys.flags.inspect:
        # PYTHONINSPECT: an interpreter would take the end for an error, whatever the code is
        exit_now(code)
    sys.exit(code)


def _prepare() -> None:
    """Readies the streams; a robot is stopped all the same where that cannot be done."""
    begin_telling()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            with suppress(OSError, ValueError):  # a degree sign in ASCII is no reason to fail
                stream.reconfigure(errors="replace")
    with suppress(OSError):
        _take_standard_files()


def _say(sentence: str, program: str) -> None:
    """Says it to whoever still reads; what was done, and the exit code, are the same for nobody."""
    with suppress(OSError):
        say(sentence, program)


def _of_robots(error: Exception, sentence: str) -> str:
    """Words on what became of robots, behind a failure where they were told something by then.

    Behind one of this program itself in any case: nobody foresaw what it is about.
    """
    deeds = done.now()
    is_open = deeds.has_said() and not deeds.is_told
    words = deeds.last_words(early.verb()) if is_open or not _is_foreseen(error) else ""
    return f" {words}" if words and words not in sentence else ""


def _end_untouched() -> None:
    """All is done: a Ctrl-C that comes while the interpreter ends does not change the exit code.

    What waits for its reader is written before, and whoever does not want to wait may say so.
    """
    with suppress(OSError, ValueError):  # it fails again in _written, and is told there
        sys.stdout.flush()
    with suppress(ValueError):  # not the main thread
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _written(program: str, code: int) -> int:
    """Exit code after the last words are written; of success 1, if they could not be.

    A stream that takes no more leads nowhere from then on: at the interpreter's end it would make
    120 of any code, and Python's words of it.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except ValueError:  # closed
            continue
        except OSError as error:
            nowhere = open_nowhere()
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
            if code == 0:
                code, sentence = _told(OSError(error.errno, error.strerror, "standard output"))
                _say(sentence, program)
    return code


def _take_standard_files() -> None:
    """Else what is opened first has a number of theirs, and gets what is printed."""
    while (handle := open_nowhere()) <= STDERR:
        closed_at_first.add(handle)
        os.set_inheritable(handle, True)
    os.close(handle)
    sys.stdout = sys.stdout or io.TextIOWrapper(io.FileIO(STDOUT, "w", closefd=False))
    sys.stderr = sys.stderr or io.TextIOWrapper(io.FileIO(STDERR, "w", closefd=False))


def _is_stop(words: list[str]) -> bool:
    """A stop of robots, which is said whatever its words are: it reads them itself."""
    return [word.lower() for word in words[:2]] == ["swarm", "stop"]


def _of_no_stop(words: list[str], verbs: Collection[str]) -> str:
    """To whoever may have asked for a stop by words that are no command, as `swarm stop-all`."""
    asked = [word.lower() for word in words[:2] if not _is_stop(words)]
    is_no_verb = asked[:1] == ["swarm"] and not {*asked[1:]} & {*TO_ROBOTS, *verbs}
    if done.now().has_said() or not (is_no_verb or any(_means_stop(word) for word in asked)):
        return ""
    return " NOTHING WAS STOPPED: `twinmill swarm stop` stops robots."


def _means_stop(word: str) -> bool:
    is_like = bool(difflib.get_close_matches(word, ["stop"], cutoff=LIKE_STOP))
    return is_like or "stop" in word or word in HALTS


def _check_encoding(words: list[str]) -> None:
    """Refuses words that no page, model file, table or JSON could hold.

    Raises:
        NotText: one is typed wrong.
        ValueError: one is the name of a file.
    """
    for word in words:
        if word != word.encode(errors="replace").decode():
            name = word.partition("=")[2] or word
            is_file = os.path.lexists(word) or os.path.lexists(name)
            remedy = "rename the file or folder" if is_file else "type it anew, in UTF-8"
            sentence = f"'{word}': is not in UTF-8; {remedy}."
            raise ValueError(sentence) if is_file else NotText(sentence)


def _told(error: Exception) -> tuple[int, str]:
    """Exit code and sentence; this is empty where help was printed instead."""
    if isinstance(error, typer.TyperException):
        sentence, code = error.format_message(), error.exit_code
        more = (
            " (--help lists what can be given)" if sentence and code == WRONG_COMMAND_LINE else ""
        )
        return code, _short(sentence + more)
    if not _is_foreseen(error):
        return _of_own(error)
    if isinstance(error, ModuleNotFoundError) and not isinstance(error, MissingExtra):
        return 1, missing(error.name or "")
    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return 1, _short(f"{error.filename or 'the output'}: {NO_ROOM[error.errno]}{_then()}.")
    if isinstance(error, OSError) and error.filename:
        return 1, _short(f"{error.filename}: {error.strerror}.")
    return 1, _short(str(error))


def _is_foreseen(error: Exception) -> bool:
    """It is told in one sentence; any other is an error of this program itself."""
    if isinstance(error, ModuleNotFoundError) and not isinstance(error, MissingExtra):
        return error.name == LAB or not (error.name or "twinmill").startswith("twinmill")
    return isinstance(error, (typer.TyperException, ImportError, OSError, ValueError))


def _of_own(error: Exception) -> tuple[int, str]:
    """Exit code and sentence of an error of this program; before it stands where that is.

    What was told by then is so all the same, and keeps its exit code.
    """
    with suppress(OSError):
        traceback.print_exception(error)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{frame.filename}:{frame.lineno}"
    words = f"an error of this program itself ({type(error).__name__} in {where}: {error})."
    return done.decided_or(1) if done.now().is_told else 1, _short(words)


def _then() -> str:
    """Words on what to do besides: nothing that robots have done already."""
    if not done.is_decided():
        return ", then do it again"
    return ". What was done is done: only what was to be printed is lost"


def _short(sentence: str) -> str:
    long = rf"(?<=[\s(=])'([^\s'][^']{{{QUOTED}}})[^']+'"  # an apostrophe stands behind a letter
    return re.sub(long, r"'\1...'", plain_line(sentence, MESSAGE_MAX))


def _print_failure(
    sentence: str, error: Exception, words: list[str], verbs: Collection[str]
) -> None:
    """The object of a command that failed before it had printed one."""
    if "--json" not in words or has_told():
        return
    findings = [] if {*words[:2]} & {*OF_TABLES} else _findings(error)
    with suppress(OSError):  # stdout itself may be what failed
        told = {"verdict": "bad_input", "sentence": sentence, "input": findings}
        print_object({**_as_of_robots(words, verbs), **told})


def _as_of_robots(words: list[str], verbs: Collection[str]) -> dict[str, Any]:
    """Fields that every object of a command to robots has, be it one that is misspelled."""
    verb = verb_of(words)
    is_other = words[0] != GROUP or verb in verbs
    return {} if is_other else {"verb": verb, "ok": False, "robots": []}


def _findings(error: Exception) -> list[dict[str, Any]]:
    """Findings on a log that cannot be judged; empty for other errors."""
    reading = sys.modules.get("twinmill.data.measurement")
    if reading and isinstance(error, reading.LogError):
        return [finding.to_json() for finding in reading.findings_of(error)]
    return []
