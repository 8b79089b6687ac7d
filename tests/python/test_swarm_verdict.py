# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm`: sentence, exit code and JSON say one thing, whatever robots answered."""

import json
import signal
from dataclasses import replace
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinmill.data.bus import Reach
from twinmill.robots.countdown import NOT_BEGUN, STOPPED, Dropouts
from twinmill.robots.fleet import DRY_RUN, Fleet, Heard
from twinmill.robots.hold import (
    BY_BUTTON,
    BY_COMMAND,
    BY_UNHEARD,
    DRIVES,
    DRIVES_ANEW,
    LINK_LOST,
    RESTARTED,
    SILENT,
    State,
    of_taken,
)
from twinmill.robots.tell import NEVER_HEARD, NO_SIGNATURE, Answer, Start
from twinmill_cli.swarm_end import finish
from twinmill_cli.swarm_signals import ENDING, KEYS, told_of_signals
from twinmill_cli.swarm_verdict import (
    Saying,
    Verdict,
    of_arm,
    of_clocks,
    of_dry_run,
    of_end,
    of_heard,
    of_select,
    of_start,
    of_stop,
)

WELL, ILL = Verdict(True, "well"), Verdict(False, "NOT ALL STAND: ill")


def answer(robot_id: int, **fields) -> Answer:
    """One that obeyed and drives."""
    usual = {
        "accepted": True,
        "signed": True,
        "reason": "",
        "mode": "running",
        "stands": False,
        "is_double": False,
        "alarms": [],
        "last_heard_s": 0.0,
    }
    return Answer(robot_id=robot_id, **(usual | fields))


GOOD, STANDS = answer(1), answer(2, mode="stopped", stands=True)
REFUSED = answer(3, accepted=False, reason="no behaviour 'dance'", mode="stopped", stands=True)
HESITANT = answer(3, accepted=False, reason="battery low", mode="")
UNSIGNED = answer(4, signed=False, mode="stopped", stands=True)
UNHEARD = answer(5, accepted=None, signed=False, reason=NEVER_HEARD, mode="", last_heard_s=None)
FAULTY = answer(6, mode="fault", alarms=["camera lost"])
LOST = answer(8, mode="stopped", stands=True, lost_link=True)
LOOSE = answer(9, link_timeout_s=0.0)
SHORT = answer(1, link_timeout_s=2.0)
DOUBLE = answer(7, mode="stopped", stands=True, is_double=True)


def begun(*answers: Answer, stopped=(), late=(), out=None, taken=(), **sent) -> Start:
    dropouts, called_off = Dropouts(out or {}, frozenset(taken)), bool(stopped or out)
    return Start(0, list(answers), {}, called_off, list(stopped), list(late), dropouts, **sent)


CUT = Saying(0.4, 0.4, is_cut_short=True)
CAUGHT = Reach(said=300, fault="eth0: not connected")
CAME_BACK = Reach(100, 40, 1.0, {"eth0"}, "eth0: not connected")
BY_START = Heard(9, 1, 7, 8, "start milling at 12:00:01")
TAKEN, TAKEN_AND_LOST = of_taken(BY_START), of_taken(BY_START, LINK_LOST)


DRY = replace(STANDS, alarms=[DRY_RUN])
# What is said begins so, and the command ends with that code.
SENTENCES = [
    (of_stop([STANDS]), "All stand.", 0),
    (
        of_stop([LOST, STANDS], Saying(to_all=True)),
        "All stand. 2 robots were heard: R08, R02. If you have more, name all",
        0,
    ),
    (
        of_stop([replace(STANDS, reason="stands, but forgets this stop if started anew: ...")]),
        "All stand. R02 stands, but forgets this stop if started anew:",
        0,
    ),
    (of_stop([STANDS], is_of_some=True), "R02 stands.", 0),
    (
        of_stop([STANDS], Saying(unheard=["robot9"])),
        "NOT ALL STAND: Nothing was heard from robot9",
        1,
    ),
    (of_stop([], Saying(unheard=["robot9"])), "No robot was heard in 10 s", 1),
    (of_stop([STANDS], is_of_some=True).beside(["R01"]), "R02 stands. R01 drives, and was", 0),
    (
        of_stop([STANDS], is_of_some=True).beside(["R01", "R03"]),
        "R02 stands. R01, R03 drive, and were not asked.",
        0,
    ),
    (of_stop([]), "No robot was heard in 10 s", 1),
    (of_stop([STANDS, GOOD]), "NOT ALL STAND: R01: no stop was confirmed.", 1),
    (of_stop([UNSIGNED, STANDS]), "NOT ALL STAND: R04: no stop was confirmed.", 1),
    (of_stop([DOUBLE, STANDS]), "NOT ALL STAND: R07: two robots have this number", 1),
    (of_stop([UNHEARD]), "NOT ALL STAND: R05: no stop was confirmed.", 1),
    (of_arm([GOOD]), "All are armed.", 0),
    (of_arm([REFUSED, GOOD]), "Not all are armed: R03", 1),
    (of_arm([DOUBLE, GOOD]), "Not all are armed: R07: two robots have this number", 1),
    (of_select([GOOD], "milling"), "All chose milling.", 0),
    (of_select([DOUBLE, GOOD], "milling"), "Not all did: R07: two robots have this number", 1),
    (of_select([REFUSED, GOOD], "dance"), "Not all did: R03 did not obey", 1),
    (of_select([replace(REFUSED, mode="running")], "dance"), "None did: R03 did not obey", 1),
    (
        of_start(begun(replace(GOOD, accepted=False, reason="no behaviour 'mlling'"), REFUSED)),
        "NOBODY STARTED: R01, R03 refused",
        1,
    ),
    (of_start(begun(SHORT, replace(LOOSE, accepted=False))), "Started at", 1),
    (of_start(begun(GOOD)), "Started at", 0),
    (of_start(begun(GOOD, replace(GOOD, alarms=[DRY_RUN]))), "Started at", 1),
    (of_stop([DRY]).more(of_dry_run([DRY])), "All stand. R02 with --dry-run", 0),
    (of_start(begun(SHORT)), "Started at", 0),
    (of_start(begun(LOOSE)), "Started at", 1),
    (of_start(begun(LOOSE, link_timeout_ms=0)), "Started at", 0),
    (of_start(begun(SHORT, link_timeout_ms=0)), "Started at", 1),
    (of_start(begun(REFUSED, GOOD)), "Started at", 1),
    (of_start(begun(FAULTY, GOOD)), "Started at", 1),
    (of_start(begun(STANDS)), "NOBODY DRIVES, though it is", 1),
    (of_start(begun(STANDS, late=[STANDS])), "NOBODY WAS HEARD TO START: R02 was not", 1),
    (of_start(begun(GOOD, STANDS, late=[STANDS])), "Started at", 1),
    (of_start(begun(REFUSED)), "NOBODY STARTED: R03 refused", 1),
    (
        of_start(begun(replace(UNHEARD, robot_id=9, mode="stopped", last_heard_s=3.0))),
        "NOBODY WAS HEARD TO START: R09 did not acknowledge in time",
        1,
    ),
    (of_start(begun(REFUSED, stopped=[STANDS])), "Called off: R03 refused", 1),
    (
        of_start(begun(UNHEARD, GOOD, stopped=[STANDS])),
        "Called off: R05 did not acknowledge in time",
        1,
    ),
    (
        of_start(begun(GOOD, stopped=[STANDS], out={1: STOPPED, 2: STOPPED})),
        "Called off: R01, R02 were stopped by another command. Ask who stopped them before you "
        "start them again. All were told to stop: All stand. They must be armed",
        1,
    ),
    (
        of_start(
            begun(
                answer(1, accepted=False, reason="was stopped: arm it first", mode="stopped"),
                stopped=[STANDS],
                out={1: STOPPED},
                stop_heard="10.0.0.2 at 12:00:01",
            )
        ),
        "Called off: R01 was stopped by another command. A stop came from 10.0.0.2 at 12:00:01: "
        "ask there before you start them again. All were told to stop: All stand. They must be "
        "armed before they start (--arm).",
        1,
    ),
    (
        of_start(begun(GOOD, stopped=[STANDS], out={1: NOT_BEGUN})),
        "Called off: R01 was not driving when the others had begun. All were told to stop: All",
        1,
    ),
    (
        of_start(begun(GOOD, out={1: "taken over"}, taken=[1], stopped=[STANDS])),
        "Called off: R01 was taken over. R01: left to that start. The others were told to stop:"
        " R02 stands.",
        1,
    ),
    (
        of_start(begun(GOOD, out={1: "taken over"}, taken=[1])),
        "Called off: R01 was taken over. R01: left to that start.",
        1,
    ),
    (
        of_stop([STANDS, GOOD], Saying(2.5, 2.5, is_cut_short=True)),
        "NOT ALL STAND: R01: no stop was confirmed. SWITCH OFF BY HAND what still drives. R01 "
        "drives. Ended by a signal after 2.5 s. R02 confirmed it.",
        1,
    ),
    (
        of_stop([], CUT),
        "No robot was heard in 0.4 s; stop was said all the time. SWITCH OFF BY HAND what still",
        1,
    ),
    (of_stop([STANDS], CUT), "R02 stands; others may not have been heard yet.", 1),
    (of_stop([STANDS], Saying(1.4, 1.4, is_cut_short=True)), "All stand.", 0),
    (of_stop([STANDS], CUT, is_of_some=True), "R02 stands.", 0),
    (
        of_stop([], Saying(reach=CAUGHT)),
        "NOTHING LEFT THIS COMPUTER (eth0: not connected; tried",
        1,
    ),
    (of_stop([STANDS], Saying(10, 0.0, reach=CAUGHT)), "R02 stands; others may not have been", 1),
    (of_stop([STANDS], Saying(reach=CAUGHT), is_of_some=True), "R02 stands. NOTHING LEFT", 0),
    (of_stop([STANDS], Saying(10, 4.0, reach=CAME_BACK)), "All stand. 60 of 100 times it did", 0),
    (of_stop([], Saying(reach=CAME_BACK)), "No robot was heard in 10 s; stop was said on eth0.", 1),
    (
        of_stop([UNSIGNED], Saying(key_fault="No signature could be checked: --key k: ...")),
        "NOT ALL STAND: R04: no stop was confirmed. SWITCH OFF BY HAND what still drives. No "
        "signature could be checked: --key k",
        1,
    ),
    (of_stop([STANDS, LOST]), "All stand. R08 stood before: it had lost its operator.", 0),
    (of_end(WELL, {"R01": TAKEN, "R02": DRIVES}, WELL), "All stand; R01 was taken over by", 1),
    (of_end(WELL, {"R01": TAKEN, "R02": TAKEN}, WELL), "All stand; R01, R02 were taken over by", 1),
    (of_end(WELL, {"R01": TAKEN_AND_LOST}, None), "All stand: R01: taken over by another", 1),
    (of_end(WELL, {"R01": DRIVES}, WELL), "All stand.", 0),
    (of_end(WELL, {"R01": DRIVES}, ILL), "NOT ALL STAND", 1),
    (of_end(ILL, {"R01": DRIVES}, WELL), "All stand; not all had started.", 1),
    (
        of_end(None, {}, WELL),
        "All stand; the start was ended before it was known to have begun; not",
        1,
    ),
    (
        of_end(None, {}, WELL, was_confirmed=True),
        "All stand; the start was ended before it was known to have begun; all had confirmed it.",
        1,
    ),
    (of_end(WELL, {"R01": RESTARTED, "R02": DRIVES}, WELL), "All stand; R01 stood before: its", 1),
    (
        of_end(WELL, {"R01": BY_BUTTON, "R02": DRIVES}, WELL),
        "All stand; R01 stood before: its b",
        0,
    ),
    (
        of_end(WELL, {"R01": LINK_LOST, "R02": DRIVES}, WELL),
        "All stand; R01 stood before: it had",
        1,
    ),
    (
        of_end(WELL, {"R01": SILENT, "R02": DRIVES}, WELL),
        "All stand; R01 had not been heard for",
        1,
    ),
    (of_end(WELL, {"R01": DRIVES_ANEW}, WELL), "All stand; R01 drove after its program was", 1),
    (of_end(WELL, {"R01": BY_COMMAND, "R02": BY_BUTTON}, None), "All stand: R01: stopped", 1),
    (of_end(WELL, {"R01": BY_UNHEARD}, None), "All stand: R01: it obeyed another operator", 1),
    (of_end(WELL, {"R01": BY_BUTTON}, None), "All stand: R01: its button was pressed.", 0),
    (of_end(WELL, {"R01": BY_COMMAND, "R02": LINK_LOST}, None), "All stand: R01: stopped", 1),
]


@pytest.mark.parametrize(("verdict", "begins", "code"), SENTENCES)
def test_each_sentence_has_its_code(verdict, begins, code):
    assert verdict.sentence.startswith(begins)
    assert verdict.code == code and verdict.ok == (code == 0)


def test_who_refused_a_start_and_drives_drives_for_somebody_else():
    """It was told that a start of a mistyped behaviour had taken over."""
    told = of_start(
        begun(SHORT, answer(3, accepted=False, reason="no behaviour 'mlling'"))
    ).sentence
    assert "refused it (no behaviour 'mlling'): R03 goes on as before this start" in told
    assert "without having confirmed" not in told


@pytest.mark.parametrize("given", [(UNHEARD,), (REFUSED, UNHEARD), (STANDS, UNHEARD)])
def test_who_is_not_heard_where_nobody_starts_may_drive(given):
    """Only that nobody was heard to start was said, and read as that nobody drives."""
    assert of_start(begun(*given)).sentence.endswith(" R05 may drive all the same.")


def test_who_is_not_heard_beside_one_that_starts_may_drive():
    said = of_start(begun(GOOD, UNHEARD)).sentence
    assert f"R05 was not heard to start ({NEVER_HEARD}), and may drive all the same. " in said


def test_a_fault_is_told_apart_from_driving():
    said = of_start(begun(FAULTY, GOOD)).sentence
    assert "but not all: R06 with a fault" in said


def test_what_a_start_says_of_a_lost_link_is_what_the_robots_have_signed():
    """A robot whose file says `link_timeout_ms = 0` had driven on, and 2 s were told."""
    well, loose = of_start(begun(SHORT)).sentence, of_start(begun(SHORT, LOOSE)).sentence
    assert "they stop by themselves 2 s after they have lost this command." in well
    assert "R09 drives on for ever without this command" in loose
    assert "R01 has not signed yet" in of_start(begun(GOOD)).sentence
    assert LOOSE.to_json()["untethered"] is True and SHORT.to_json()["link_timeout_s"] == 2.0
    assert GOOD.to_json()["untethered"] is None


@pytest.mark.parametrize(
    "verdict",
    [
        of_arm([REFUSED, UNHEARD]),
        of_select([REFUSED, UNHEARD], "dance"),
        of_start(begun(REFUSED, UNHEARD, GOOD)),
        of_start(begun(REFUSED, UNHEARD, stopped=[STANDS], out={})),
    ],
)
def test_each_sentence_stands_alone(verdict):
    """Whoever reads JSON sees no table above it."""
    assert "above" not in verdict.sentence and "no behaviour 'dance'" in verdict.sentence


def test_what_is_called_off_says_whether_all_stand():
    still, moving = (of_start(begun(REFUSED, stopped=[a])) for a in (STANDS, GOOD))
    assert "All stand." in still.sentence and "NOT ALL STAND: R01" in moving.sentence


@pytest.mark.parametrize("given", [[], [STANDS], [UNHEARD]])
def test_an_answer_that_may_not_be_heard_is_said_to_come_by_multicast_alone(given):
    """Robots that a stop by their address reached stood, and the address was doubted."""
    for unheard in ([], ["robot9"]) if given != [STANDS] else (["robot9"],):
        verdict = of_stop(given, Saying(unheard=unheard))
        assert verdict.code == 1 and "SWITCH OFF BY HAND what still drives." in verdict.sentence
        assert "by multicast" in verdict.sentence


@pytest.mark.parametrize(
    ("answers", "options", "is_told"),
    [
        ([GOOD], {}, True),
        ([GOOD, REFUSED], {}, True),
        ([replace(GOOD, accepted=None)], {}, True),  # drives, and has not confirmed it
        ([STANDS], {}, True),  # by a clock that is behind it may begin late
        ([REFUSED, replace(GOOD, accepted=False)], {}, False),
        ([UNHEARD], {}, False),
        ([GOOD], {"stopped": [STANDS]}, False),
    ],
)
def test_an_instant_is_told_only_where_a_robot_was_to_start_at_it(answers, options, is_told):
    assert (begun(*answers, **options).begun_utime_us is not None) == is_told


def test_a_robot_that_was_never_heard_is_said_so_with_what_to_do():
    said = of_stop([UNHEARD, STANDS]).sentence
    assert "R05: was not heard by this command." in said and "--host" in said


answers = st.builds(
    answer,
    st.integers(0, 99),
    accepted=st.sampled_from([True, False, None]),
    signed=st.booleans(),
    reason=st.sampled_from(["", NEVER_HEARD, "no behaviour 'x'"]),
    mode=st.sampled_from(["", "stopped", "running", "script", "fault"]),
    stands=st.booleans(),
    is_double=st.booleans(),
)


@given(st.lists(answers, max_size=4))
def test_all_stand_is_said_with_code_0_and_only_of_robots_that_have_signed_it(given):
    verdict = of_stop(given)
    assert verdict.ok == verdict.sentence.startswith("All stand.")
    sure = [a.accepted and a.signed and a.stands and not a.is_double for a in given]
    assert verdict.ok == (bool(given) and all(sure))


@given(st.lists(answers, min_size=1, max_size=4))
def test_a_start_is_well_only_where_all_have_signed_it_and_drive(given):
    """And have nothing to say of it, as that no wheel turns, or that two robots have its number."""
    verdict = of_start(begun(*given))
    signed = [a.accepted and a.signed and not (a.reason or a.is_double) for a in given]
    drive = [
        is_so and a.mode in ("running", "script") for is_so, a in zip(signed, given, strict=True)
    ]
    assert (
        verdict.ok
        == all(drive)
        == ("not all" not in verdict.sentence.lower() and "NOBODY" not in verdict.sentence)
    )


@pytest.mark.parametrize("verdict", [Verdict(True, "yes."), Verdict(False, "no.")])
@pytest.mark.parametrize("last", [STANDS, REFUSED])
def test_the_table_of_robots_changes_nothing_of_the_verdict(capsys, verdict, last):
    """The last robot of the table had decided."""
    given, fleet = [REFUSED, UNSIGNED, last], Fleet("", connect=lambda _: Mock())
    assert finish("stop", given, verdict, {}, fleet=fleet, as_json=True) == verdict.code
    data = json.loads(capsys.readouterr().out)
    assert (data["ok"], data["sentence"]) == (verdict.ok, verdict.sentence)
    assert finish("stop", given, verdict, {}, fleet=fleet, as_json=False) == verdict.code
    assert verdict.sentence in capsys.readouterr().out
    fleet._prefix = "TWIN_"
    assert finish("stop", given, verdict, {}, fleet=fleet, as_json=True) == verdict.code
    data = json.loads(capsys.readouterr().out)
    assert data["addressed"] == {"channel_prefix": "TWIN_"} and data["ok"] == verdict.ok
    assert data["sentence"].startswith("Only robots with --channel-prefix TWIN_ are meant; ")


def test_a_silent_robot_keeps_the_others_held():
    assert not SILENT.stands and not SILENT.is_meant


def test_a_start_that_turns_no_wheel_by_a_robots_own_word_has_not_gone_as_it_was_meant():
    still = replace(GOOD, reason="no wheel turns: duty_cap_pct is 0 in the robot's configuration")
    told = of_start(begun(still, GOOD))
    assert told.code == 1 and "R01 accepted it (no wheel turns: duty_cap_pct is 0" in told.sentence


def test_who_refuses_a_behaviour_while_it_drives_is_said_to_go_on():
    told = of_select([replace(REFUSED, mode="running")], "dance").sentence
    assert told.endswith("R03 goes on with what it did.")


def test_a_selection_that_a_countdown_overrides_has_not_gone_as_it_was_meant():
    """Said by the robot itself, as it will play something else."""
    waits = replace(STANDS, reason="a start that it waits for plays milling")
    told = of_select([STANDS, waits], "diffusing")
    assert told.code == 1
    words = "R02 will not play diffusing (a start that it waits for plays milling)"
    assert told.sentence.startswith(words)
    assert of_select([STANDS], "diffusing").code == 0


@pytest.mark.parametrize(
    ("clock_s", "says"),
    [
        ({"R01": 0.01, "R02": -0.02}, []),
        (
            {"R01": 0.01, "R02": 86400.0},
            ["R02's clock is 86400.00 s ahead of this computer's, with which R01 agrees: set its"],
        ),
        (
            {"R01": -3.0, "R02": -3.02},
            ["this computer's clock is 3.01 s ahead of those of R01, R02, which agree: set this"],
        ),
        ({"R01": 7.0}, ["R01's clock is 7.00 s ahead of this computer's: set all (NTP)"]),
        (
            {"R01": 7.0, "R02": -9.0},
            ["R01's clock is 7.00 s ahead of", "R02's clock is 9.00 s behind", "set all (NTP)"],
        ),
        ({"R01": float("nan")}, []),  # nothing of it was heard
    ],
)
def test_the_clock_that_is_odd_is_named(clock_s, says):
    """This computer's where all robots agree with each other, and a robot's where others do not."""
    told = of_clocks(clock_s, 1.0)
    assert all(words in told for words in says) and bool(told) == bool(says)


@pytest.mark.parametrize(
    ("ahead_s", "then"),
    [
        (86400.0, "refuses the start"),  # which is over 2 s ago by its clock
        (-86400.0, "refuses the start"),  # which is over 600 s ahead
        (0.3, "starts 0.30 s early"),
        (-0.3, "starts 0.30 s late"),
        (2.5, "starts 1.00 s early"),  # at once: no earlier than it is told
    ],
)
def test_what_an_odd_clock_makes_of_a_start_is_what_the_robot_does(ahead_s, then):
    """fw_command_judge() refuses over FW_START_LATE_US and FW_START_AHEAD_US."""
    assert of_clocks({"R01": 0.0, "R02": ahead_s}, 1.0).endswith(f"By that, R02 {then}")


def test_a_stop_says_that_a_robot_has_another_key():
    """It may well stand, and this operator cannot know."""
    told = of_stop([STANDS, replace(UNSIGNED, reason=NO_SIGNATURE)])
    assert not told.ok and "R04: no stop was confirmed" in told.sentence
    assert "R04: is not heard to sign with this operator's key" in told.sentence
    assert "R04: by its word, which nobody can check, it stands." in told.sentence
    assert "R02: is not heard to sign" not in told.sentence
    silent = replace(UNSIGNED, reason=NO_SIGNATURE, last_heard_s=9.0)
    assert "it stands" not in of_stop([STANDS, silent]).sentence


@pytest.mark.parametrize(
    ("ended", "signals", "code"),
    [
        (of_end(WELL, {"R01": DRIVES}, WELL), [signal.SIGINT], 130),
        (of_end(None, {}, WELL), [signal.SIGTSTP], 130),
        (of_end(WELL, {"R01": DRIVES}, WELL), [signal.SIGTERM], 0),
        (of_end(None, {}, WELL), [signal.SIGTERM], 1),
        (of_end(WELL, {"R01": DRIVES}, ILL), [signal.SIGINT], 1),
        (of_end(WELL, {"R01": RESTARTED}, WELL), [signal.SIGINT], 1),
        (of_end(WELL, {"R01": BY_COMMAND, "R02": DRIVES}, WELL), [signal.SIGINT], 130),
        (of_end(WELL, {"R01": BY_COMMAND, "R02": DRIVES}, WELL), [signal.SIGTERM], 1),
        (of_start(begun(LOOSE, link_timeout_ms=0)), [signal.SIGINT], 0),
    ],
)
def test_a_key_ends_a_shells_loop_and_hides_nothing_that_is_wrong(ended, signals, code):
    """130 means that all stand: who drives on without an operator was not stopped by a late key."""
    assert ended.more("R01's clock is odd.").beside(["R05"]).code_after(signals) == code


@pytest.mark.parametrize(
    ("signals", "says"),
    [
        ([signal.SIGXCPU], "Stopped by SIGXCPU: CPU time limit exceeded."),
        ([signal.SIGHUP, signal.SIGINT], "Stopped by SIGHUP: "),
        ([signal.SIGRTMIN + 2], "Stopped by SIGRTMIN+2: "),
        ([signal.SIGINT, signal.SIGTERM], ""),
        ([], ""),
    ],
)
def test_what_stopped_a_start_is_named_unless_a_key_did(signals, says):
    """`ulimit -t` stopped robots after a minute, and "All stand." was all that was said."""
    told = told_of_signals(signals)
    assert told.startswith(says) and bool(told) == bool(says)


def test_each_signal_that_ends_a_start_has_a_name():
    assert all(told_of_signals([n]).count("SIG") == 1 for n in set(ENDING) - KEYS)


def test_a_stop_that_is_not_confirmed_by_robots_that_stand_says_both():
    """They stood by their lost links, said one sentence, and the next that not all stand."""
    lost = answer(1, accepted=None, signed=False, reason="no answer", mode="stopped")
    lost = replace(lost, lost_link=True, signs_standing=True)
    told = of_stop([lost])
    assert told.code == 1 and "NOT ALL STAND" not in told.sentence
    assert told.sentence.startswith("NOT ALL HAVE CONFIRMED: R01: no stop was confirmed.")
    assert "R01 signs all the same that it stands: R01 had lost its operator" in told.sentence
    silent = replace(lost, robot_id=2, signs_standing=False)
    assert of_stop([lost, silent]).sentence.startswith("NOT ALL STAND: R01, R02: no stop was")


@pytest.mark.parametrize("stopped", [WELL, ILL])
def test_a_fault_is_told_whatever_became_of_the_stop_of_others(stopped):
    """It was left out where another robot had not confirmed its stop."""
    fault = State("has a fault: camera lost", "had a fault: camera lost")
    ended = of_end(WELL, {"R01": LINK_LOST, "R02": fault, "R03": SILENT}, stopped)
    for words in ("R01 stood before: it had lost", "R02 had a fault: camera", "R03 had not been"):
        assert words in ended.sentence


def test_who_stood_and_is_not_heard_any_more_is_told_with_both():
    """Its own words, while the hold went on, were that it stood."""
    silent = answer(1, accepted=None, signed=False, reason="no answer", mode="", last_heard_s=9.0)
    ended = of_end(WELL, {"R01": LINK_LOST, "R02": DRIVES}, of_stop([silent, STANDS]))
    assert ended.code == 1 and ended.sentence.startswith("NOT ALL STAND: R01")
    assert ended.sentence.endswith("R01 stood before: it had lost its link to this command.")


@pytest.mark.parametrize(
    ("old", "words"),
    [
        ((), "1 robot was heard: R01. If"),
        ((2, 3), "1 robot was heard: R01, and by old news alone R0"),
    ],
)
def test_old_news_is_not_counted_as_heard(old, words):
    assert of_heard([1], old).startswith(words)


def test_who_refused_a_start_is_said_to_stand_only_as_it_has_signed():
    for refused, words in (
        ([REFUSED], "but not all: R03 refused it (no behaviour 'dance'), and stands. "),
        (
            [REFUSED, replace(REFUSED, robot_id=4)],
            "R03, R04 refused it (no behaviour 'dance'), and stand. ",
        ),
        ([HESITANT], "but not all: R03 refused it (battery low). "),
    ):
        assert words in of_start(begun(*refused, GOOD)).sentence
