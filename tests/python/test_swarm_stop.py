# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm stop` where nobody answers: a person sees at once what it waits for."""

import errno
import json
import os
import pty
import re
import shlex
import signal
import socket
import sys
import time
from contextlib import suppress
from unittest.mock import Mock

import pytest

from twinmill.data.bus import Reach
from twinmill.robots import tell
from twinmill.robots.fleet import Fleet
from twinmill.robots.key import load
from twinmill_cli import early, ending, swarm_door, swarm_stop
from twinmill_cli.lazy import asks_for_help
from twinmill_cli.main import main
from twinmill_cli.swarm_door import key_fault
from twinmill_cli.swarm_signals import saying_nothing
from twinmill_cli.swarm_verdict import Saying, of_stop


def test_a_stop_that_nobody_hears_says_at_once_what_it_waits_for(monkeypatch, tmp_path, twinmill):
    monkeypatch.setenv("HOME", str(tmp_path))
    begin_s, said_s, words, stop = [], [], swarm_stop.waiting_words, swarm_stop.tell.stop

    def begin(*given, **options):
        begin_s.append(time.monotonic())
        return stop(*given, **options)

    def timed(*given):
        said_s.append(time.monotonic() - begin_s[0])
        return words(*given)

    monkeypatch.setattr(swarm_stop.tell, "stop", begin)
    monkeypatch.setattr(swarm_stop, "waiting_words", timed)
    url = "udpm://239.255.76.67:7999?ttl=0"
    code, out, _ = twinmill("swarm", "stop", "--lcm-url", url, "--timeout-s", "2")
    assert code == 1 and len(said_s) == 1 and said_s[0] < 1.5
    assert "No robot was heard" in out and "--host" in out


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGUSR1, signal.SIGALRM, signal.SIGXCPU])
def test_a_stop_outlives_the_terminal_that_it_came_from(monkeypatch, tmp_path, twinmill, number):
    """As where ssh breaks off while robots out of reach have not yet signed."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(early, "COUNTING", ())  # the handlers before it are those of this test
    ended = []
    monkeypatch.setattr(swarm_stop, "waiting_words", lambda *_: os.kill(os.getpid(), number) or "")
    before = signal.signal(number, lambda *_: ended.append("hung up"))
    try:
        code, out, _ = twinmill("swarm", "stop", "--lcm-url", "memq://", "--timeout-s", "2")
        assert code == 1 and "No robot was heard" in " ".join(out.split()) and not ended
        os.kill(os.getpid(), number)
        assert ended == ["hung up"]
    finally:
        signal.signal(number, before)


def test_who_never_commanded_a_robot_gets_no_key_by_stopping_or_looking(
    monkeypatch, tmp_path, twinmill
):
    """A new key is no robot's: it would say nothing but that none signs with it."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    url = "udpm://239.255.76.67:7999?ttl=0"
    for words in (["stop", "--timeout-s", "0.5"], ["status", "--once"]):
        code, out, err = twinmill("swarm", *words, "--lcm-url", url)
        assert code == 1 and "there is no key here" in out + err
    assert not list(tmp_path.rglob("*.key"))


def test_a_word_that_nobody_reads_keeps_no_stop_waiting():
    """A pipe that is full, as of a pager, takes nothing more."""
    reads, writes = os.pipe()
    os.set_blocking(writes, False)
    full = 0
    while full < 2**20:
        try:
            full += os.write(writes, b"x" * 4096)
        except BlockingIOError:
            break
    os.set_blocking(writes, True)
    kept = os.dup(2)
    os.dup2(writes, 2)
    try:
        with saying_nothing() as say:
            say("stop is said")
    finally:
        os.dup2(kept, 2)
    for handle in (reads, writes, kept):
        os.close(handle)


@pytest.mark.parametrize("is_lost", ["/dev/null", "every file"])
def test_a_stop_needs_no_dev_null(monkeypatch, tmp_path, twinmill, is_lost):
    """It ended with a traceback before it had said anything."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(os, "devnull", str(tmp_path / "none"))
    if is_lost == "every file":
        monkeypatch.setattr(ending, "open_nowhere", Mock(side_effect=OSError(errno.EMFILE, "full")))
    code, out, _ = twinmill("swarm", "stop", "--lcm-url", "memq://", "--timeout-s", "0.5")
    assert code == 1 and "stop was said all the time" in " ".join(out.split())


def test_whatever_fails_before_a_stop_is_told_with_what_became_of_robots(monkeypatch, twinmill):
    monkeypatch.setattr(ending, "_take_standard_files", Mock(side_effect=RuntimeError("broken")))
    code, _, err = twinmill("swarm", "stop", "--lcm-url", "memq://")
    assert code == 1 and "broken" in err and "NOTHING WAS STOPPED" in err


@pytest.mark.parametrize(
    "robots",
    ["", "1;2", "1-2", "R01", "100", "1,1", "1_2", "\u0661", "1, 2", "1,2\u00a0", "1,2\udca0"],
)
def test_a_selection_that_cannot_be_read_stops_all_and_says_so(
    monkeypatch, tmp_path, twinmill, robots
):
    """Who asks for a stop means one: who was meant is asked later."""
    monkeypatch.setenv("HOME", str(tmp_path))
    told = []
    monkeypatch.setattr(swarm_stop.tell, "stop", lambda _, asked, *a, **k: told.append(asked) or [])
    words = ["--robots", robots, "--lcm-url", "memq://", "--json"]
    code, out, _ = twinmill("swarm", "stop", *words)
    said = json.loads(out)
    assert code == 2 and told == [set()] and not said["ok"]
    assert "'--robots'" in said["sentence"] and "all robots are told to stop" in said["sentence"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--json --robots", "'--robots' requires an argument"),
        ("--json --robots 1 --robots 2", "is given twice"),
        ("--json 1,2", "unexpected extra argument"),
        ("--json --robots 1 2", "unexpected extra argument"),
        ("--json --robot 1", "No such option: --robot"),
        ("--robots=1 --jsn --json", "No such option: --jsn"),
        ("--json --robots 1 --timeout-s nan", "nan is no finite number"),
        ("--robots 1 --timeout-s 0 --json", "'--timeout-s'"),
        ("--json=1 --json", "does not take a value"),
        ("--json --host", "'--host' requires an argument"),
        ("--json --key", "'--key' requires an argument"),
        ("--json --channel-prefix", "'--channel-prefix' requires an argument"),
    ],
)
def test_a_command_line_that_cannot_be_read_stops_all_and_says_so(
    monkeypatch, tmp_path, twinmill, words, says
):
    """The principle of --robots, whatever the fault: nobody has to find it while robots drive."""
    monkeypatch.setenv("HOME", str(tmp_path))
    told, fleet = [], swarm_stop.Fleet
    monkeypatch.setattr(swarm_stop.tell, "stop", lambda _, asked, *a, **k: told.append(asked) or [])
    monkeypatch.setattr(
        swarm_stop, "Fleet", lambda url, prefix, *a: told.append((url, prefix)) or fleet(url)
    )
    prefix = "" if "--channel-prefix" in words else "TWIN_"
    options = ["--lcm-url", "memq://", *(["--channel-prefix=TWIN_"] * bool(prefix)), *words.split()]
    code, out, _ = twinmill("swarm", "stop", *options)
    said = json.loads(out)
    assert code == 2 and told == [("memq://", prefix), set()] and not said["ok"]
    assert says in said["sentence"] and " So all robots are told to stop." in said["sentence"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--robots", "1,2\udca0"], 2),
        (["\udca0"], 2),
        (["--timeout-s", "1\udca0"], 2),
        (["--channel-prefix", "TWIN_\udca0"], 2),
        (["--key", "m\udcfchle.key"], 1),
        (["--host", "robot\udca003"], 1),
        ([], 1),
    ],
)
def test_words_that_are_no_text_keep_no_stop_from_being_said(
    monkeypatch, tmp_path, capsys, words, code
):
    """A byte of another encoding, as a paste or an old file name has it; HOME is such a one."""
    home = tmp_path / "m\udcfchle"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    told = []
    monkeypatch.setattr(swarm_stop.tell, "say_stop", lambda fleet, asked: told.append(asked))
    line = ["twinmill", "swarm", "stop", "--lcm-url", "memq://", "--json", *words]
    line += [] if "--timeout-s" in words else ["--timeout-s", "0.5"]
    monkeypatch.setattr(sys, "argv", line)
    with pytest.raises(SystemExit) as ended:
        main()
    said = json.loads(capsys.readouterr().out)
    assert ended.value.code == code and told == [set()] and not said["ok"]
    assert "\udca0" not in said["sentence"] and "\udcfc" not in said["sentence"]
    assert ("all robots are told to stop" in said["sentence"]) == (code == 2)


@pytest.mark.parametrize("words", [["start", "--robots", "1\udca0"], ["select", "m\udcfc"]])
def test_words_that_are_no_text_are_to_be_typed_anew(monkeypatch, capsys, words):
    """They were names of files to be renamed."""
    monkeypatch.setattr(sys, "argv", ["twinmill", "swarm", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    err = capsys.readouterr().err
    assert ended.value.code == 2 and "is not in UTF-8; type it anew" in err


def test_a_stop_is_said_before_a_file_is_read(monkeypatch, twinmill):
    """A key on a file system that hangs may never be read."""
    order = []
    monkeypatch.setattr(swarm_stop.tell, "say_stop", lambda *_: order.append("stop"))
    monkeypatch.setattr(swarm_stop, "key_if_there", lambda _: order.append("key") or (None, ""))
    twinmill("swarm", "stop", "--lcm-url", "memq://", "--timeout-s", "0.5")
    assert order == ["stop", "key"]


@pytest.mark.parametrize(
    "words",
    [
        ["stop"],
        ["swarm", "stopp"],
        ["robot", "stop"],
        ["STPO"],
        ["swarm", "stop-all"],
        ["swarm", "pause"],
        ["swarm", "--robots", "1"],
        ["swarm", "--behavior", "stop"],
        ["stop_robots"],
        ["halt"],
    ],
)
def test_a_stop_in_words_that_are_no_command_says_that_nothing_was_stopped(twinmill, words):
    code, _, err = twinmill(*words)
    assert code == 2 and "NOTHING WAS STOPPED: `twinmill swarm stop` stops robots." in err


@pytest.mark.parametrize("words", ["Stop", "STOP --ROBOTS 1"])
def test_a_stop_is_one_however_its_letters_are(monkeypatch, tmp_path, twinmill, words):
    monkeypatch.setenv("HOME", str(tmp_path))
    told = []
    monkeypatch.setattr(swarm_stop.tell, "stop", lambda _, asked, *a, **k: told.append(asked) or [])
    code, _, _ = twinmill("swarm", *words.split(), "--lcm-url", "memq://")
    assert code == 1 and told == [{1} if "1" in words else set()]


@pytest.mark.parametrize(
    "words",
    [
        ["--lcm-url", "udp://1.2.3.4:7667"],
        ["--lcm-url", "udpm://239.255.76.67:7667?ttl=x"],
        ["--lcm-url", "udpm://10.0.0.1:7667"],
        ["--lcm-url", "memq://", "--lcm-url", "memq://"],
        ["--lcm-url"],
        ["--robot", "1", "--lcm-url"],
    ],
)
def test_a_stop_whose_bus_cannot_be_read_says_that_nothing_was_stopped(twinmill, words):
    """Nobody knows on which network those are who are meant."""
    code, _, err = twinmill("swarm", "stop", *words)
    assert code == 2 and "NOTHING WAS STOPPED" in err and len(err.splitlines()) == 1


@pytest.mark.parametrize(
    "words",
    [
        ["-h", "robot03"],
        ["robot03", "--help"],
        ["-H", "robot03"],
        ["--json", "-h"],
        ["-h", "-h"],
        ["--host", "-h"],
        ["stop"],
    ],
)
def test_a_stop_with_other_words_than_a_request_for_help_stops(
    monkeypatch, tmp_path, twinmill, words
):
    """`stop -h robot03` printed the help, and robots drove on; -h is near to --host."""
    monkeypatch.setenv("HOME", str(tmp_path))
    told = []
    monkeypatch.setattr(swarm_stop.tell, "stop", lambda _, asked, *a, **k: told.append(asked) or [])
    code, out, err = twinmill("swarm", "stop", *words, "--lcm-url", "memq://")
    assert told == [set()] and "Usage:" not in out and "NOTHING WAS STOPPED" not in out + err
    assert code == (1 if words[0] == "--host" else 2)


@pytest.mark.parametrize(
    ("words", "is_help"),
    [
        ("swarm stop -h", True),
        ("swarm STOP --HELP", True),
        ("swarm stop -h robot03", False),
        ("swarm -h robot03 stop", False),
        ("swarm -h stop", True),
        ("swarm --json stop -h", False),
        ("swarm -h", True),
        ("swarm start --robots 1 -h", True),
    ],
)
def test_what_a_stop_needs_is_imported_unless_it_asks_for_help_alone(words, is_help):
    assert asks_for_help(words.split()) == is_help


@pytest.mark.parametrize("words", [["swarm", "stop", "--help"], ["swarm", "-h", "stop"]])
def test_a_stop_alone_shows_its_help(twinmill, words):
    code, out, _ = twinmill(*words)
    assert code == 0 and "Usage: twinmill swarm stop" in " ".join(out.split())


@pytest.mark.parametrize(
    ("words", "code", "asked"),
    [
        ("swarm --robots 1 stop", 1, {1}),
        ("swarm --robots=1 STOP", 1, {1}),
        ("swarm --json stop --robots 1", 1, {1}),
        ("--robots 1 swarm stop", 1, {1}),
        ("swarm --json -- stop", 1, set()),
        ("swarm --channel-prefix start stop --robots 2", 1, {2}),
        ("swarm --robots 1;2 stop", 2, set()),
        ("swarm --all stop", 2, set()),
        ("swarm -r 1 stop", 2, set()),
        ("swarm -h robot03 stop", 2, set()),
    ],
)
def test_a_stop_behind_its_options_stops(monkeypatch, tmp_path, twinmill, words, code, asked):
    """An operator in a hurry had been told that there is no such option, and robots drove on."""
    monkeypatch.setenv("HOME", str(tmp_path))
    told = []
    monkeypatch.setattr(swarm_stop.tell, "stop", lambda _, asked, *a, **k: told.append(asked) or [])
    found, out, err = twinmill(*words.split(), "--lcm-url", "memq://")
    assert (found, told) == (code, [asked]) and "NOTHING WAS STOPPED" not in out + err


def test_a_refused_value_is_named_once(twinmill):
    _, _, err = twinmill("swarm", "stop", "--lcm-url", "x")
    assert err.startswith("twinmill: Invalid value for '--lcm-url': x: ")
    assert err.count("Invalid value") == 1


def test_blanks_around_a_machines_name_are_no_part_of_it(monkeypatch, tmp_path, twinmill):
    """As of a paste: an address with one was said to be no machine's name."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    words = ["stop", "--host", " 127.0.0.1 ", "--timeout-s", "0.5", "--lcm-url", "memq://"]
    _, out, _ = twinmill("swarm", *words, "--json")
    said = json.loads(out)["sentence"]
    assert "Nothing was heard from 127.0.0.1: is" in said


@pytest.mark.parametrize("name", ["", " "])
def test_a_machine_without_a_name_stops_all_and_is_named(monkeypatch, tmp_path, twinmill, name):
    """As an unset variable of a script leaves; it was said that nothing was heard from `.`."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    words = ["stop", "--host", name, "--timeout-s", "0.5", "--lcm-url", "memq://"]
    code, out, _ = twinmill("swarm", *words, "--json")
    said = json.loads(out)["sentence"]
    assert code == 2 and "'--host': is empty" in said and "So all robots are told to stop." in said
    assert "heard from" not in said


def test_a_key_that_is_made_is_told_with_what_to_do(monkeypatch, tmp_path, twinmill):
    """Where HOME was wrong, robots answered, did not obey, and nobody knew why."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    _, _, err = twinmill("swarm", "arm", "--lcm-url", "memq://")
    made = tmp_path / "twinmill" / "swarm.key"
    assert made.exists() and f"a new operator's key was made, {made}, which no robot has" in err
    assert "`twinmill robot flash HOST`" in err and "--key" in err
    _, _, err = twinmill("swarm", "arm", "--lcm-url", "memq://")
    assert "was made" not in err


def test_what_is_to_be_done_with_a_key_can_be_pasted_into_a_shell(tmp_path):
    key = tmp_path / "USB STICK" / "swarm.key"
    key.parent.mkdir()
    key.write_bytes(b"ab" * 32)
    key.chmod(0o644)
    with pytest.raises(ValueError, match="others may read it") as told:
        load(key)
    (command,) = re.findall("`(.*)`", str(told.value))
    assert shlex.split(command) == ["chmod", "600", str(key)]
    refused = PermissionError(errno.EACCES, "Permission denied", str(key))
    *_, owning = re.findall("`(.*?)`", key_fault(refused))
    assert shlex.split(owning) == ["sudo", "chown", "$USER", str(key)]


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (socket.EAI_AGAIN, "give the address instead"),
        (socket.EAI_NONAME, "no machine of that name"),
    ],
)
def test_a_name_server_that_is_away_knows_of_no_machine(monkeypatch, code, says):
    def look_up(_):
        raise socket.gaierror(code, "as getaddrinfo says")

    monkeypatch.setattr("socket.gethostbyname", look_up)
    hosts = tell.Hosts(["robot02.lab"])
    end_s = time.monotonic() + 5
    while not hosts._faults and time.monotonic() < end_s:
        time.sleep(0.01)
    assert says in hosts._faults["robot02.lab"]


@pytest.mark.parametrize(
    ("text", "mode", "says"),
    [
        ("ab" * 32, 0o644, "others may read it (mode 644): `chmod 600"),
        ("ab" * 20, 0o600, "this has 40 characters"),
        ("zz" * 32, 0o600, "hexadecimal digits (0-9, a-f)"),
        ("AB" * 32, 0o600, "in small letters"),  # robots read no capitals
        ("\udcff\udcfe", 0o600, "this has 2 characters"),
    ],
)
@pytest.mark.parametrize("verb", ["start", "arm", "stop", "status"])
def test_a_key_that_cannot_be_used_is_named_with_its_remedy(
    monkeypatch, tmp_path, twinmill, verb, text, mode, says
):
    """Its robots were told apart from others by it, and were said to have another key."""
    key = tmp_path / "swarm.key"
    key.write_bytes(text.encode(errors="surrogateescape"))
    key.chmod(mode)
    more = ["--timeout-s", "0.5"] if verb == "stop" else []
    words = [verb, "--lcm-url", "memq://", "--key", key, "--json", *more]
    code, out, err = twinmill("swarm", *words)
    assert code == 1 and f"--key {key}" in out + err and says in out + err
    said = json.loads(out)
    if verb in ("start", "arm"):
        assert "Nothing was said to any robot." in said["sentence"]
    if verb == "stop":
        assert "No robot's signature could be checked: " in said["sentence"]
    if verb == "status":
        assert says in said["key_fault"]


@pytest.mark.parametrize("verb", ["start", "stop", "status"])
def test_a_key_that_is_a_link_to_itself_is_there(tmp_path, twinmill, verb):
    key = tmp_path / "swarm.key"
    key.symlink_to(key)
    more = ["--timeout-s", "0.5"] if verb == "stop" else []
    code, out, err = twinmill("swarm", verb, "--lcm-url", "memq://", "--key", key, "--json", *more)
    assert code == 1 and f"{key}: {os.strerror(errno.ELOOP)}." in out + err


@pytest.mark.parametrize(
    "verb", ["start", "arm", "select milling", "characterise", "stop", "status"]
)
def test_a_key_that_is_named_and_not_there_is_refused_and_not_made(
    monkeypatch, tmp_path, twinmill, verb
):
    """A mistyped name had made a key that no robot has, without a word."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.csv").write_text("t_s,speed_input,turn_input\n0,0,0\n1,0,0\n")
    more = {
        "characterise": "--robot 3 --script s.csv --out run.lcmlog",
        "stop": "--timeout-s 0.5",
        "status": "--once",
    }.get(verb, "")
    words = [*([] if verb == "characterise" else ["swarm"]), *verb.split(), *more.split()]
    code, out, _ = twinmill(*words, "--key", "my.kye", "--lcm-url", "memq://", "--json")
    told = json.loads(out)
    said = told["key_fault"] if verb == "status" else told["sentence"]
    assert code == 1 and "--key my.kye: there is no key here" in said
    assert "`twinmill robot flash HOST --key my.kye`" in said
    assert [path.name for path in tmp_path.iterdir()] == ["s.csv"]


@pytest.mark.parametrize(
    "words",
    [
        ["start", "--robots", ""],
        ["start", "--robots", "1,2,1"],
        ["start", "--behavior", ""],
        ["start", "--channel-prefix", ""],
        ["start", "--untethered", "--link-timeout-s", "3"],
        ["start", "--lcm-url", "udp://1.2.3.4:7667"],
        ["arm", "--robots", ""],
        ["arm", "--lcm-url", "239.255.76.67:7667"],
        ["select", ""],
        ["select", "milling", "--robots", "100"],
        ["status", "--lcm-url", "udpm://nowhere"],
    ],
)
def test_what_is_malformed_is_refused_at_the_door(monkeypatch, tmp_path, twinmill, words):
    """Before a robot, or a key, is looked for."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    code, out, err = twinmill("swarm", *words)
    assert code == 2 and not out and len(err.splitlines()) == 1, err
    code, out, _ = twinmill("swarm", *words, "--json")
    said = json.loads(out)
    assert (said["verb"], said["ok"], said["verdict"]) == (words[0], False, "bad_input")
    assert not list(tmp_path.rglob("*.key"))


@pytest.mark.parametrize(("verb", "words"), [("start", []), ("arm", []), ("select", ["milling"])])
def test_ctrl_c_before_a_robot_was_told_anything_says_so(
    monkeypatch, key_file, twinmill, verb, words
):
    """While it looks who is there: nothing at all was said."""

    class Quiet:
        """Ctrl-C comes while nobody is heard."""

        def subscribe(self, *_):
            pass

        def handle_timeout(self, _):
            os.kill(os.getpid(), signal.SIGINT)
            return False

    monkeypatch.setattr(swarm_door, "Fleet", lambda *_, key: Fleet("", "", lambda _: Quiet(), key))
    options = ["--key", key_file, "--json"]
    code, out, err = twinmill("swarm", verb, *words, *options)
    sentence = "Ended by a signal: nothing was said to any robot."
    assert code == 130 and err == f"twinmill: {sentence}\n"
    assert json.loads(out) == {"verb": verb, "ok": False, "sentence": sentence, "robots": []}


def test_a_stop_that_no_network_takes_says_so_and_is_tried_until_one_does(monkeypatch):
    """The error of the kernel is told, and how often; once it is gone the stop goes out."""
    bus = LostBus(fails=20)
    fleet = Fleet("", connect=lambda _: bus)
    given = tell.stop(fleet, set(), 0.3)
    reach = fleet.reach
    verdict = of_stop(given, Saying(0.3, tell.reached_s(fleet, 0.3), reach=reach))
    assert verdict.code == 1 and reach.out == 0 and reach.said > 2
    assert (
        f"NOTHING LEFT THIS COMPUTER (eth0: Network is unreachable; tried {reach.said} times"
        in (verdict.sentence)
    )
    assert "said all the time" not in verdict.sentence and "--host" not in verdict.sentence
    words = swarm_stop.waiting_words(fleet, set(), tell.Hosts(()), 0.3)
    assert words.startswith("nothing leaves this computer (eth0: Network is unreachable)")
    tell.stop(fleet, set(), 1.0)
    assert 0 < fleet.reach.out < fleet.reach.said


class LostBus:
    """A network that is gone for a number of packets, and then comes back."""

    def __init__(self, fails):
        self.reach, self.fails = Reach(), fails

    def subscribe(self, *_):
        pass

    def handle_timeout(self, timeout_ms):
        time.sleep(timeout_ms / 1e3)
        return False

    def publish(self, *_):
        self.fails -= 1
        if self.fails < 0:
            self.reach.note({"eth0"}, "")
            return
        self.reach.note(set(), "eth0: Network is unreachable")
        raise OSError("the bus cannot be reached")


class Listener:
    """One who is told sentences, and then gives a signal or does not."""

    def __init__(self, signals, *numbers):
        self.said, self.numbers, self._signals = [], numbers, signals

    def say(self, sentence):
        self.said.append((time.monotonic(), sentence))
        self._signals += self.numbers


@pytest.mark.parametrize(
    ("numbers", "least_s", "most_s"), [((signal.SIGINT,), 0.3, 1.5), ((signal.SIGHUP,), 2.0, 4.0)]
)
def test_the_end_of_a_start_says_at_once_what_it_waits_for(monkeypatch, numbers, least_s, most_s):
    """Ten silent seconds after Ctrl-C; another one there ends it, as it ends `swarm stop`."""
    monkeypatch.setattr(swarm_stop.tell, "STOP_S", 2.0)
    said_s, signals = [], [signal.SIGINT] * 5
    bus, listener = LostBus(fails=1000), Listener(signals, *numbers)
    publish, fleet = bus.publish, Fleet("", connect=lambda _: bus)

    def timed(*words):
        said_s.append(time.monotonic())
        publish(*words)

    bus.publish = timed
    halt, begin_s = swarm_stop.LastStop(listener, signals), time.monotonic()
    verdict = of_stop(halt(fleet, {2}), halt.how)
    assert least_s < time.monotonic() - begin_s < most_s
    ((told_s, words),) = listener.said
    assert said_s[0] < told_s < begin_s + 1.5
    assert words.startswith("nothing leaves this computer (eth0: Network is unreachable)")
    assert verdict.code == 1 and verdict.sentence.startswith("NOT ALL STAND: R02")
    assert ("Ended by a signal after" in verdict.sentence) == (numbers == (signal.SIGINT,))


TELLS_IN_BACKGROUND = """
set -m; stty tostop
{python} -c 'from twinmill_cli.swarm_signals import counting_signals as counting
with counting():
    print("robots drive", flush=True)' &
wait $!; echo ended $?; kill -KILL %1
"""


def test_a_terminal_that_halts_who_writes_in_the_background_halts_no_operator():
    """Robots drove for the 2 s in which they had not lost it, and nobody was told."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.execvp("bash", ["bash", "-c", TELLS_IN_BACKGROUND.format(python=sys.executable)])
    said = b""
    with suppress(OSError):  # the end of a terminal
        while got := os.read(terminal, 4096):
            said += got
    os.waitpid(pid, 0)
    os.close(terminal)
    assert b"robots drive" in said and b"ended 0" in said
