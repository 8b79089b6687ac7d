# SPDX-License-Identifier: Apache-2.0
"""The session without a screen says what the commands say, and makes the same files."""

import os
import shlex
import shutil

import lcm
import numpy as np
import pytest

from twinmill.data.checks import InputFinding
from twinmill.data.log import LogError
from twinmill.model.model_file import ModelError
from twinmill.model.parameters import CLOCK
from twinmill.workbench.session import Session
from twinmill.workbench.worker import perform
from twinmill_cli import main as cli


@pytest.fixture(scope="module")
def opened(brief_coasting_robot, tmp_path_factory):
    """A session in a folder with log and model; tests leave it where the model as given stands."""
    folder, before = tmp_path_factory.mktemp("session"), os.getcwd()
    shutil.copy(brief_coasting_robot.log, folder / "run.lcmlog")
    shutil.copy(brief_coasting_robot.model, folder / "model.toml")
    os.chdir(folder)
    session = Session([type(folder)("run.lcmlog")], "model.toml")
    session.read()
    session.measure()
    session.judge(0)
    session.exclude_wrong([])
    session.conclude()
    yield session
    os.chdir(before)


def predicted(session):
    """Prediction that is drawn for the first robot."""
    return session.robots[0].predicted(session.shown(0).model)


@pytest.fixture(scope="module")
def compared(opened):
    return cli.run(["compare", "run.lcmlog", "--model", "model.toml"])


@pytest.fixture
def session(opened):
    yield opened
    opened.go(0)


def test_the_score_is_that_of_compare(session, compared):
    assert session.tree.scores[0].fitted == pytest.approx(compared.score, rel=1e-9)
    assert session.shown(0).score == pytest.approx(compared.score, rel=1e-9)


def test_checks_that_find_nothing_wrong_leave_what_is_shown(session):
    """They may come while a first answer is on the screen."""
    session.show(session.preview("coasting", 0))
    foreseen = session.shown(0)
    session.exclude_wrong([])
    assert session.shown(0) is foreseen and session.beside.label == "before"


def test_regimes_are_those_of_compare_and_their_moments_lie_in_the_log(session, compared):
    mine, theirs = session.regimes(0), compared.main.where
    assert [(r.group, r.regime, r.windows) for r in mine] == [
        (r.group, r.regime, r.windows) for r in theirs
    ]
    assert [r.ratio for r in mine] == pytest.approx([r.ratio for r in theirs], rel=1e-9)
    times, worst = session.moments(0, mine[0].group, mine[0].regime)
    assert worst in times
    assert len(times) >= mine[0].windows


def test_predictions_follow_a_knob_and_come_back(session):
    before = predicted(session)["ahead"]
    session.drag("base.forward_gain", 1.2)
    turned = predicted(session)["ahead"]
    assert np.nanmax(np.abs(turned - before)) > 0.05  # 20 % of 0.36 m/s for two seconds
    session.keep()
    session.score_now()
    assert session.tree.scores[session.tree.current.number].fitted > session.tree.scores[0].fitted
    session.undo()
    np.testing.assert_array_equal(predicted(session)["ahead"], before)


def test_a_score_is_of_its_model_though_a_hand_leads_elsewhere_meanwhile(session, monkeypatch):
    given = session.tree.scores[0]
    session.set("base.yaw_gain", 0.5)
    number, settled = session.tree.current.number, session.settled

    def left_meanwhile(*which):
        session.undo()
        return settled(*which)

    monkeypatch.setattr(session, "settled", left_meanwhile)
    session.score_now()
    assert session.tree.current.number == 0 and session.tree.scores[0] is given
    assert session.tree.scores[number].fitted > given.fitted


def test_a_file_that_changes_meanwhile_is_told(session):
    path = session.given.path
    text = path.read_text()
    assert not session.is_outdated
    path.write_text(text.replace("name", "# name", 1))
    assert session.is_outdated
    path.unlink()
    assert session.is_outdated
    path.write_text(text)
    assert not session.is_outdated


def test_errors_drawn_are_measured_less_predicted(session, compared):
    drawn = predicted(session)["errors"]
    rows = compared.main.errors[:, 2]  # half a second ahead
    np.testing.assert_allclose(drawn[:, 1], np.hypot(rows[:, 0], rows[:, 1]), rtol=1e-6)
    np.testing.assert_allclose(drawn[:, 2], rows[:, 2], rtol=1e-6)


def test_a_saved_model_is_the_file_that_the_commands_write(session, tmp_path):
    session.set("base.yaw_gain", 0.97)
    session.held = {"base.sideways_gain"}
    done = perform(session.work("add", "coasting"), session.paths, {}, print)
    session.take(done)
    scores = session.tree.scores[session.tree.current.number]
    assert scores.fitted < 1.15 < session.tree.scores[0].fitted  # as good as the log can tell
    commands = session.save(type(tmp_path)("mine.toml"))
    mine = (session.paths[0].resolve().parent / "mine.toml").read_bytes()
    os.remove("mine.toml")
    results = [cli.run(shlex.split(command)[1:]) for command in commands]
    assert mine == (session.paths[0].resolve().parent / "mine.toml").read_bytes()
    assert scores.fitted == pytest.approx(results[-1].after.score, rel=1e-9)
    assert scores.heldout == pytest.approx(results[-1].heldout_after.score, rel=1e-9)


def test_views_show_a_model_on_the_clock_that_compare_finds_for_it(session):
    """A slower motor is late, and so are clocks found with a faster one: 90 ms are seen."""
    session.set("base.motor_lag_s", 0.15)
    session.save(type(session.paths[0])("slow.toml"))
    compared = cli.run(["compare", "run.lcmlog", "--model", "slow.toml"])
    assert session.shown(0).score == pytest.approx(compared.score, rel=1e-3)
    on_the_clock_before = session.robots[0].opened.with_model(session.model_file.model).score
    assert session.shown(0).score < 0.9 * on_the_clock_before


def test_as_a_hand_turns_a_knob_the_clock_goes_with_it(session):
    """One step of the search each time is enough."""
    for lag_s in (0.08, 0.1, 0.12, 0.14, 0.145, 0.15):
        session.drag("base.motor_lag_s", lag_s)
        dragged = session.shown(0)
    session.keep()
    settled = session.shown(0)
    assert dragged.model.get(CLOCK) == pytest.approx(settled.model.get(CLOCK), abs=0.005)
    assert dragged.score == pytest.approx(settled.score, rel=0.02)


def test_the_first_answer_of_an_addition_is_near_the_full_one(session):
    previewed = session.preview("coasting", 0)
    done = perform(session.work("add", "coasting"), session.paths, {}, print)
    assert previewed[0].score == pytest.approx(done.result["score_after"], rel=0.1)


def test_a_session_goes_on_where_it_was_left(session):
    session.set("base.motor_lag_s", 0.08)
    other = Session(session.paths, "model.toml")
    other.read()
    other.restore(session.to_json())
    assert other.model_file.text == session.model_file.text
    assert other.tree.can_undo


def test_a_session_of_another_model_is_not_taken_for_this_one(session):
    other = Session(session.paths, "turbopi.toml")
    other.read()
    with pytest.raises(ModelError, match="another model"):
        other.restore(session.to_json())


def test_the_model_as_given_is_not_saved_again(session):
    with pytest.raises(ModelError, match="as given"):
        session.save(type(session.paths[0])("copy.toml"))


def test_a_robot_that_the_checks_find_wrong_is_left_out_of_the_scores(session, compared, write_log):
    """They come after the first predictions: places and scores are then those of the others."""
    *events, _ = lcm.EventLog("run.lcmlog", "r")
    wrong = write_log(*((e.channel, e.data) for e in events), name="wrong.lcmlog")
    two = Session([wrong, *session.paths], "model.toml")
    two.read()
    two.measure()
    two.judge(1)
    number = two.measurements[0].track.robot_id
    two.exclude_wrong(
        [InputFinding("exchanged", "by 9 %", "mend it", True, "wrong.lcmlog", number)]
    )
    two.conclude()
    assert [m.log_name for m in two.measurements] == ["run.lcmlog"]
    assert two.notes == [f"Left out: wrong.lcmlog R{number:02d}: exchanged: by 9 %; mend it."]
    assert two.tree.scores[0].fitted == pytest.approx(compared.score, rel=1e-9)
    with pytest.raises(LogError, match="exchanged"):
        two.exclude_wrong(
            [InputFinding("exchanged", "by 9 %", "mend it", True, "run.lcmlog", number)]
        )


def test_a_robot_of_which_a_while_is_cut_out_is_judged_without_it(session):
    own = Session(session.paths, "model.toml")
    own.read()
    own.measure()
    own.judge(0)
    (run,) = own.measurements
    cut_s = tuple(float(t) for t in run.track.pose_t_s[[400, 800]])
    name, number = run.log_name, run.track.robot_id
    own.exclude_wrong([InputFinding("mixed up", "so", "look", False, name, number, (cut_s,))])
    starts_s = own.robots[0].opened.data.start_s
    assert len(starts_s) and not ((starts_s > cut_s[0]) & (starts_s < cut_s[1])).any()


def test_a_log_that_is_not_there_is_one_sentence(session):
    with pytest.raises(LogError, match="cannot be read"):
        Session([type(session.paths[0])("none.lcmlog")], "model.toml").read()
