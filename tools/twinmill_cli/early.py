# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C, or a failure, where no command has taken signals over, as in the second of imports.

One sentence: an exception in the midst of imports would be a traceback, or be swallowed by a
library. Behind a command to robots, too, signals come back here, and do nothing once its end is
decided.
"""

import _signal  # the part of `signal` that takes no time to import
import os
import sys
from contextlib import suppress
from types import TracebackType

from twinmill_cli import done
from twinmill_cli.exit_now import STOPPED, exit_now
from twinmill_cli.own_path import PROGRAMS, is_program
from twinmill_cli.word_order import TO_ROBOTS, verb_of

# Below `swarm`: these take signals over themselves, and never leave them to defaults; what moves
# robots begins only if nobody has asked for an end.
COUNTING = ("start", "arm", "select", "stop")
# As a background job of a script has SIGINT, and `nohup` SIGHUP, these are ignored at first.
ENDING = (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP)


def verb() -> str:
    """The word behind `swarm`, if any."""
    return verb_of(sys.argv[1:])


def _name() -> str:
    name = os.path.basename(sys.argv[0])
    return name if name in PROGRAMS else PROGRAMS[0]


def _leave(number: int, _: object) -> None:
    """Ends the program, but where a stop loses its terminal, or all is decided and about to end."""
    is_of_stop = number == _signal.SIGHUP and verb() == "stop"
    if is_of_stop or done.is_decided():
        return
    tell_end()
    if verb():
        exit_now(STOPPED)
    os._exit(STOPPED)


def tell_end() -> None:
    """Tells that a signal ended the command, and what robots were told: a sentence, an object."""
    name, has_said = verb(), done.now().has_said()
    if has_said:
        sentence = f"Ended by a signal. {done.now().last_words(name)}"
    elif name == "stop":
        sentence = f"Stopped before it began. {done.now().last_words(name)}"
    else:
        sentence = "Stopped before it began: nothing was done, and nothing was sent."
    with suppress(OSError):
        if name in TO_ROBOTS and "--json" in sys.argv:
            # In the midst of imports there is no `json`; nothing is quoted then.
            quoted = sys.modules["json"].dumps(sentence) if has_said else f'"{sentence}"'
            told = f'"verb": "{name}", "ok": false, "sentence": {quoted}, "robots": []'
            os.write(1, f"{{{told}}}\n".encode())
    with suppress(OSError):
        os.write(2, f"{_name()}: {sentence}\n".encode(errors="replace"))


def begin() -> None:
    """From now on Ctrl-C leaves, unless something else was made of it.

    Where robots are told something, so does each signal that asks for the end, be it ignored or
    held back until now.
    """
    with suppress(ValueError):  # not in the main thread
        if is_program() and verb() in COUNTING:
            for number in ENDING:
                _signal.signal(number, _leave)
            _signal.pthread_sigmask(_signal.SIG_UNBLOCK, ENDING)
        elif _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
            _signal.signal(_signal.SIGINT, _leave)


def end() -> None:
    """From now on Ctrl-C is a KeyboardInterrupt again, but where the command counts signals."""
    is_counted = is_program() and verb() in COUNTING
    if _signal.getsignal(_signal.SIGINT) is _leave and not is_counted:
        _signal.signal(_signal.SIGINT, _signal.default_int_handler)


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
