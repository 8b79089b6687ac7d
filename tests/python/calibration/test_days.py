# SPDX-License-Identifier: Apache-2.0
"""One robot on several days: the rate of false alarms, names, sizes, moments, histories, drift."""

import json
from dataclasses import replace
from itertools import pairwise
from math import erf, factorial, sqrt
from pathlib import Path

import numpy as np
import pytest
from same_robot import MOMENT_S, WEAKER, mounting

from twinmill.chance import t_quantile
from twinmill.data.measurement import load_measurements
from twinmill.model.model_file import ModelFile
from twinmill.runs.alarm import alarm
from twinmill.runs.changes import Judged, Kind
from twinmill.runs.compare import compared, open_run
from twinmill.runs.difference import difference
from twinmill.runs.drift import drift
from twinmill.runs.history import Calibration, Number, append, healthy_logs, read_history
from twinmill.runs.rate import promised, rank_p, runs_for
from twinmill.runs.reference import Day, steadier

KINDS = [
    Kind("a", "a is", "weaker", "stronger", "1", np.array([1.0, 0.0])),
    Kind("b", "b is", "weaker", "stronger", "1", np.array([0.0, 1.0])),
]


def _day(values) -> Day:
    return Day(np.array(values, float), np.ones(2), np.eye(2), 10, 0.0)


# -- the rate -----------------------------------------------------------------------------------


def test_a_rank_is_false_exactly_as_often_as_it_says():
    """Among N exchangeable scores each is as likely the new one: p takes k/N with chance 1/N."""
    scores = [0.3, 2.0, 1.1, 0.7, 5.0]
    others = [scores[:k] + scores[k + 1 :] for k in range(5)]
    ranks = sorted(rank_p(s, o) for s, o in zip(scores, others, strict=True))
    assert ranks == pytest.approx([1 / 5, 2 / 5, 3 / 5, 4 / 5, 1.0])


def test_the_rate_that_few_healthy_runs_can_promise():
    assert (promised(0.05, 4), promised(0.05, 19), promised(0.05, 99)) == (1 / 5, 0.05, 0.05)
    assert (runs_for(0.05), runs_for(0.1), runs_for(0.01)) == (19, 9, 99)


@pytest.mark.parametrize("spread", [1.0, 30.0])
def test_one_of_twenty_days_would_be_an_alarm_whatever_their_errors_are(spread):
    """Each of 20 exchangeable days is as likely the last one, and one of these is an alarm."""
    random = np.random.default_rng(3)
    days = [_day(v) for v in random.standard_t(2, (20, 2)) * [spread, 1.0]]
    alarms = [bool(alarm([*days[k + 1 :], *days[: k + 1]], KINDS, 0.05).found) for k in range(20)]
    assert sum(alarms) == 1


def test_errors_alone_are_those_of_the_largest_of_independent_normal_variates():
    """(2 Phi(x) - 1)^2 is the chance that neither of two is larger; one alone is Student's t."""
    many = Judged(np.zeros(2), np.diag([4.0, 0.1]), 1e6, KINDS)
    x = float(np.quantile(many.by_errors, 0.95))
    assert erf(x / sqrt(2)) ** 2 == pytest.approx(0.95, abs=0.006)  # 4 sigma of so many draws
    one = replace(many, free=5, kinds=KINDS[:1])
    assert one.chance(t_quantile(0.975, 5)) == pytest.approx(0.05, abs=0.006)


def test_what_varies_between_healthy_days_is_no_alarm_and_what_does_not_is():
    """Days scatter by 10 in one number and by their errors of 1 in the other."""
    random = np.random.default_rng(4)
    days = [_day(v) for v in random.standard_normal((30, 2)) * [10.0, 1.0]]
    assert not alarm([*days, _day([15.0, 0.0])], KINDS, 0.05).found
    ((change, _),) = alarm([*days, _day([0.0, 15.0])], KINDS, 0.05).found
    assert change.kind.key == "b" and change.value == pytest.approx(15.0, abs=4 / sqrt(30))


def test_days_that_differ_in_one_way_hide_no_change_in_another():
    """They scatter by 10 along a + b and not along a - b, of which a change of a by 5 is half."""
    random = np.random.default_rng(5)
    common = 10 * random.standard_normal((30, 1)) + random.standard_normal((30, 2))
    days = [_day(v) for v in [*common, [5.0, 0.0]]]
    ((change, _),) = alarm(days, KINDS, 0.05).found
    assert change.kind.key == "a" or change.value < 0  # b less by 5 is the same half
    assert abs(change.value) == pytest.approx(5.0, abs=4 * sqrt(2 * (1 + 1 / 30)))


def test_of_two_estimates_the_one_that_scatters_less_from_day_to_day_is_taken():
    random = np.random.default_rng(6)
    values = random.standard_normal((20, 2))
    rough, fine = ([_day(scale * v) for v in values] for scale in (3.0, 1.0))
    assert steadier([rough, fine], KINDS) is fine
    assert steadier([fine, rough], KINDS) is fine


def test_nine_of_ten_changes_of_the_size_that_is_said_would_be_an_alarm():
    """By normal variates: a threshold of 3 is passed by 9 of 10 from 3 + 1.2816 on, 2 each."""
    own = replace(alarm([_day([0, 0])] * 2, KINDS, 0.05), healthy=(1.0,) * 18 + (3.0,))
    change = replace(own.tested.changes()[0], std=2.0, free=1e6)
    assert own.above == 3.0
    size = own.shown(change, 0.9)
    assert 0.5 * (1 - erf((3.0 - size / 2.0) / sqrt(2))) == pytest.approx(0.9, abs=1e-4)


# -- two runs -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def opened(same_robot):
    model = ModelFile.load(str(same_robot["first"].parent / "model.toml"))
    return {
        name: open_run(load_measurements([log], model.model)[0], model)
        for name, log in same_robot.items()
    }


def test_a_robot_on_another_day_did_not_change_though_its_marker_did(opened):
    found = compared(opened["first"], opened["whole"], (), 0.05)
    assert not found.changed and found.remounted
    assert found.alarm.p_rank is None and found.to_json()["promised_rate"] is None


def test_a_weak_wheel_is_named_with_its_size(opened):
    found = compared(opened["first"], opened["weak"], (), 0.05)
    change, own = found.changes[0].change, found.changes[0]
    assert change.kind.key == "wheel.fl" and own.onset.from_start
    low, high = change.interval
    assert low < -WEAKER < high and high < 0


def test_a_wheel_that_has_always_been_weak_did_not_change_though_the_model_lacks_it(opened):
    assert not compared(opened["weak"], opened["always"], (), 0.05).changed


def test_a_wheel_that_was_weak_in_the_first_run_alone_is_stronger_in_the_second(opened):
    change = compared(opened["weak"], opened["whole"], (), 0.05).changes[0].change
    low, high = change.interval
    assert change.kind.key == "wheel.fl" and 0 < low < WEAKER / (1 - WEAKER) < high


def test_white_steps_tell_by_how_much_a_wheel_is_weaker_to_a_tenth_of_it(opened):
    white = difference(opened["first"], opened["weak"]).precise().only(["wheel.fl"])
    bound = float(np.sqrt(white.by_curvature[0, 0]))
    assert bound < WEAKER / 10 and abs(white.values[0] + WEAKER) < 4 * bound


def test_the_moment_is_found_from_which_on_a_wheel_is_weak(opened):
    found = compared(opened["first"], opened["later"], (), 0.05)
    at = next(n.onset for n in found.changes if n.change.kind.key == "wheel.fl")
    # Predictions of up to 2 s that begin before the moment see it, too.
    assert not at.from_start and at.low_s - 2.5 < MOMENT_S < at.high_s + 2.5


def test_a_marker_is_where_it_was_mounted_though_a_wheel_grew_weak_meanwhile(opened):
    """To 2.5 mm and half a degree of how the mountings were drawn, by the run since then."""
    found = compared(opened["first"], opened["later"], (), 0.05)
    differs = np.subtract(mounting("later"), mounting("first"))
    told = [found.size_of(f"marker.{key}")[0] for key in ("x_m", "y_m", "bias_rad")]
    assert found.remounted and np.all(np.abs(told - differs) < [2.5e-3, 2.5e-3, np.radians(0.5)])


def test_exit_codes_tell_scripts_whether_anything_changed(twinmill, same_robot, tmp_path):
    model = same_robot["first"].parent / "model.toml"
    words = ("compare-runs", same_robot["first"], "--model", model, "--json")
    code, out, _ = twinmill(*words[:2], same_robot["whole"], *words[2:])
    assert code == 0 and json.loads(out)["verdict"] == "unchanged"
    page = tmp_path / "page"
    code, out, _ = twinmill(*words[:2], same_robot["weak"], *words[2:], "--out", page)
    told = json.loads(out)
    assert code == 3 and told["verdict"] == "changed" and told["changes"][0]["name"] == "wheel.fl"
    assert "front left wheel" in told["sentence"] and (page / "index.html").is_file()


# -- histories ----------------------------------------------------------------------------------


def _calibration(day: int, value: float, std: float = 0.01, robot: int = 1) -> Calibration:
    numbers = (
        Number("base.yaw_gain", value, std, "1", "yaw_gain"),
        Number("base.motor_lag_s", 0.06, 0.001, "s", "motor_lag_s"),
    )
    utime_us = 1_700_000_000_000_000 + day * 86_400_000_000
    return Calibration(
        utime_us, robot, "m.toml", "ab", ((f"{day}.lcmlog", str(day)),), 1.0, numbers
    )


def _history(path: Path, values) -> Path:
    for day, value in enumerate(values):
        append(path, _calibration(day, value))
    return path


def test_a_history_is_read_as_it_was_written_by_date(tmp_path):
    path = tmp_path / "robot.jsonl"
    lines = [_calibration(day, 0.9 + day / 100) for day in (2, 0, 1)]
    for line in lines:
        append(path, line)
    again = replace(lines[1], score=1.3)  # of the same log
    append(path, again)
    assert read_history(path) == [again, lines[2], lines[0]]
    assert json.loads(path.read_text().splitlines()[0])["date"] == "2023-11-16T22:13:20Z"


def test_a_line_that_cannot_be_written_whole_leaves_the_history_as_it_was(tmp_path, monkeypatch):
    path = _history(tmp_path / "robot.jsonl", [0.9])
    before = path.read_bytes()

    def fails(_):
        raise OSError("no space")

    monkeypatch.setattr("twinmill.runs.history.os.fsync", fails)
    with pytest.raises(OSError, match="no space"):
        append(path, _calibration(1, 0.9))
    assert path.read_bytes() == before


def test_logs_that_have_no_date_are_compared_in_the_order_of_their_fits(twinmill, tmp_path):
    """Stamps that count from a start of their own tell no order, and no day of 1970."""
    path = tmp_path / "r.jsonl"
    for number, value in enumerate((1.001, 0.999, 1.0, 1.002, 0.998, 1.0, 0.9)):
        append(path, replace(_calibration(number, value, 0.001), recorded_utime_us=-number))
    code, out, _ = twinmill("drift", path, "--out", tmp_path / "page")
    page = (tmp_path / "page" / "index.html").read_text()
    assert code == 3 and "(yaw_gain) left its band: 0.900" in " ".join(out.split())
    assert "19" not in out.split("calibrations, ")[1].split("\n")[0] and "date unknown" in page
    told = json.loads(twinmill("drift", path, "--json")[1])
    assert [point["date"] for point in told["numbers"][0]["points"]] == [None] * 7


@pytest.mark.parametrize("damage", ['{"date": "20', "[]", '{"recorded_utime_us": 1}', "\x00\x00"])
def test_a_damaged_line_is_told_by_its_number(twinmill, tmp_path, damage):
    path = _history(tmp_path / "robot.jsonl", [0.9, 0.91])
    path.write_text(path.read_text() + damage + "\n")
    code, _, err = twinmill("drift", path)
    assert code == 1 and err.count("\n") == 1 and "line 3 is damaged" in err


def test_a_fit_appends_its_numbers_and_their_logs_are_healthy_runs(twinmill, same_robot, tmp_path):
    model, log = same_robot["first"].parent / "model.toml", same_robot["first"]
    history, new = tmp_path / "robot.jsonl", tmp_path / "new.toml"
    words = ("fit", log, "--model", model, "--history", history, "--json")
    code, out, _ = twinmill(*words, "-o", new)
    (line,) = read_history(history)
    told = {p["name"]: p["value"] for p in json.loads(out)["parameters"]}
    assert code == 0 and all(n.value == told[n.name] for n in line.numbers)
    assert healthy_logs([history]) == ([(tmp_path / line.logs[0][0])], [])
    history.write_text(history.read_text().replace('"robot_id": 1', '"robot_id": 7'))
    code, _, err = twinmill(*words, "-o", tmp_path / "other.toml")
    assert code == 1 and "robot 7" in err and not (tmp_path / "other.toml").exists()


def test_a_history_takes_no_table_of_steady_speeds(twinmill, tmp_path):
    header = "robot_id,speed_input,direction_deg,turn_input,run,speed_mps,turn_radps,note\n"
    rows = [f"1,{speed},90,0,1,{speed / 300},0," for speed in (30, 60, 90)]
    (tmp_path / "table.csv").write_text(header + "\n".join(rows) + "\n")
    words = ("fit", tmp_path / "table.csv", "--model", "turbopi_nominal.toml", "-o", tmp_path / "m")
    code, _, err = twinmill(*words, "--history", tmp_path / "robot.jsonl")
    assert code == 1 and "these hold a table of steady speeds; fit each robot's logs" in err
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


def test_a_log_that_is_gone_or_another_one_is_left_out_of_the_healthy_runs(tmp_path):
    path = _history(tmp_path / "robot.jsonl", [0.9, 0.91])
    (tmp_path / "1.lcmlog").write_text("another")
    logs, said = healthy_logs([path, Path("x.lcmlog")])
    assert logs == [Path("x.lcmlog")]
    assert "0.lcmlog is not there" in said[0] and "1.lcmlog has changed" in said[1]


# -- drift --------------------------------------------------------------------------------------


def test_a_number_that_jumps_leaves_its_band(twinmill, tmp_path):
    steady = [0.9, 0.91, 0.905, 0.898, 0.902, 0.907, 0.895]
    path = _history(tmp_path / "robot.jsonl", [*steady, 0.9])
    code, out, _ = twinmill("drift", path, "--json")
    assert code == 0 and json.loads(out)["left"] == []
    append(path, _calibration(9, 1.2))
    code, out, _ = twinmill("drift", path, "--json", "--out", tmp_path / "page")
    assert code == 3 and json.loads(out)["left"] == ["base.yaw_gain"]
    assert (tmp_path / "page" / "index.html").is_file()


def test_a_band_of_equal_errors_is_the_prediction_interval_of_student():
    """Mean +- t(n - 1) s sqrt(1 + 1/n), where the scatter is all there is."""
    values = [1.0, 2.0, 4.0, 3.0]
    found = drift([_calibration(k, v, std=1e-9) for k, v in enumerate([*values, 2.5])], 0.05)
    own = next(s for s in found.series if s.last.name == "base.yaw_gain")
    reach = t_quantile(1 - 0.05 / 8, 3) * np.std(values, ddof=1) * sqrt(1 + 1 / 4)
    assert (own.low[-1], own.high[-1]) == pytest.approx((2.5 - reach, 2.5 + reach), rel=1e-6)


def test_a_steady_drift_within_the_band_is_a_trend():
    """One order of 8 values in 8! rises all the time, and one falls."""
    rising = [0.9 + 0.004 * k for k in range(8)]
    assert all(a < b for a, b in pairwise(rising))
    found = drift([_calibration(k, v) for k, v in enumerate(rising)], 0.05)
    own = next(s for s in found.series if s.last.name == "base.yaw_gain")
    assert own.trend_p == pytest.approx(2 / factorial(8)) and own.drifts and not own.outside[-1]
