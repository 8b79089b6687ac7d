# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C, or a failure, before a command has begun, as in the second of imports: one sentence.

An exception in the midst of imports would be a traceback, or be swallowed by a library.
"""

import _signal  # the part of `signal` that takes no time to import
import os
import sys
from contextlib import suppress
from types import TracebackType
from typing import Any, NoReturn

from twinmill_cli import done
from twinmill_cli.exit_now import STOPPED, exit_now
from twinmill_cli.own_path import PROGRAMS, is_program
from twinmill_cli.word_order import GROUP, in_order

MOVING = ("start", "arm", "select")  # below `swarm`: they begin only if nobody has asked for an end
# As a background job of a script has SIGINT, and `nohup` SIGHUP, these are ignored at first.
ENDING = (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP)


def verb() -> str:
    """The word behind `swarm`, if any."""
    words = in_order(sys.argv[1:])
    return "".join(words[1:2]).lower() if words[:1] == [GROUP] else ""


def _name() -> str:
    name = os.path.basename(sys.argv[0])
    return name if name in PROGRAMS else PROGRAMS[0]


def _leave(*_: Any) -> NoReturn:
    sentence = "Stopped before it began: nothing was done, and nothing was sent."
    if verb() in MOVING and "--json" in sys.argv:  # in the midst of imports there is no `json`
        told = f'"verb": "{verb()}", "ok": false, "sentence": "{sentence}", "robots": []'
        os.write(1, f"{{{told}}}\n".encode())
    os.write(2, f"{_name()}: {sentence}\n".encode(errors="replace"))
    if verb():
        exit_now(STOPPED)
    os._exit(STOPPED)


def begin() -> None:
    """From now on Ctrl-C leaves, unless something else was made of it.

    Where robots are to move, so does each signal that asks for the end, be it ignored or held back
    until now.
    """
    with suppress(ValueError):  # not in the main thread
        if is_program() and verb() in MOVING:
            for number in ENDING:
                _signal.signal(number, _leave)
            _signal.pthread_sigmask(_signal.SIG_UNBLOCK, ENDING)
        elif _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
            _signal.signal(_signal.SIGINT, _leave)


def end() -> None:
    """From now on Ctrl-C is a KeyboardInterrupt again, and the other signals end the program."""
    for number in ENDING:
        if _signal.getsignal(number) is _leave:
            is_int = number == _signal.SIGINT
            _signal.signal(number, _signal.default_int_handler if is_int else _signal.SIG_DFL)


def why_not_begun(error: BaseException) -> str:
    """Sentence on a part of this program that cannot be imported."""
    trace = error.__traceback__
    while trace and trace.tb_next:
        trace = trace.tb_next
    where = f" in {trace.tb_frame.f_code.co_filename}" if trace else ""
    return (
        f"a part of this program cannot be imported ({type(error).__name__}{where}: {error}); if "
        "that is no file of yours, which another name would put out of the way, install Twinmill "
        f"again. {done.now().last_words(verb())}"
    ).strip()


def tell_failure(kind: type, error: BaseException, trace: TracebackType | None) -> None:
    """An exception hook that tells of an import in one sentence, and with --json in an object.

    Once a command has begun it is no import that failed: typer has kept this hook.
    """
    if done.now().has_begun:
        sys.__excepthook__(kind, error, trace)
        return
    sentence = why_not_begun(error)
    os.write(2, f"{_name()}: {sentence}\n".encode(errors="replace"))
    if "--json" in sys.argv:
        import json  # may itself be what fails

        told = {"verdict": "bad_input", "sentence": sentence, "input": []}
        robots = {"verb": verb(), "ok": False, "robots": []} if verb() else {}
        os.write(1, f"{json.dumps({**robots, **told})}\n".encode())
