# SPDX-License-Identifier: Apache-2.0
"""The published claims against their references, and that a wrong number would be found."""

import json
from collections import Counter
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import twinmill_native as native
import typer
from scipy.stats import chi2

from twinmill.data.steady_table import read_steady_tables
from twinmill.model.model_file import ModelFile
from twinmill_cli import main as cli
from twinmill_lab.claims import (
    bodies,
    claims,
    fidelity,
    last_figure,
    paper,
    pivot,
    prediction,
    process,
    rows,
    swarms,
)
from twinmill_lab.claims.actuation import _spread_interval, actuation
from twinmill_lab.claims.claims import CLAIMS
from twinmill_lab.claims.swarms import KINDS, run, run_kept

SEEDS = 100


@pytest.fixture(scope="module", autouse=True)
def computed_once():
    """Published equations and swarms depend on their arguments alone: each is computed once."""
    run_anew = claims.Points.run
    run_once = cache(run_anew)
    parts_anew, part_anew, known = swarms.run_here, fidelity.run_part, {}

    def run_points(points, *args, **more):
        many = np.ndim(points.v_mps)  # arrays cannot be looked up
        return (run_anew if many else run_once)(points, *args, **more)

    def run_parts(request, parts, workers):
        if request.sha256 not in known:
            known[request.sha256] = dict(parts_anew(request, parts, workers))
        return known[request.sha256].items()

    def run_part(request, worlds):
        key = request.sha256, worlds
        if key not in known:
            known[key] = part_anew(request, worlds)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(claims.Points, "run", run_points)
        patch.setattr(swarms, "run_here", run_parts)
        patch.setattr(fidelity, "run_part", run_part)
        yield


ELSEWHERE = ("prediction", "fidelity")  # tested with their own sizes


@pytest.mark.parametrize("name", [name for name in CLAIMS if name not in ELSEWHERE])
def test_numbers_agree_and_only_what_was_seen_is_said_to_be(name):
    claim = CLAIMS[name](SEEDS)
    for row in claim.rows:
        print(row.what, row.value, row.reference, row.agrees, row.rule)
    assert claim.agrees
    asked = dict.fromkeys(("alike", "sensor", "steps", "pivot", "questions"))
    assert claim.seen is {"bullseye": False, **asked}.get(name, True)
    assert claim.count[1] >= 2 or name == "questions"  # whose numbers are those of other claims
    assert claim.count[0] >= claim.count[1] - len(claims.KNOWN_MORE)
    judged = [row for row in claim.rows if row.rule.endswith("deviations") and not row.known]
    off = [float(row.rule.split()[0]) for row in judged] or [0.0]
    # Squares of standard deviations sum up to chi squared; one page in a thousand exceeds this.
    most = max(1.5, np.sqrt(chi2.ppf(0.999, len(off)) / len(off)))
    assert np.sqrt(np.mean(np.square(off))) < most
    assert all("<svg" in figure.svg for figure in claim.figures)


@pytest.mark.parametrize(("table", "key", "wrong"), [
    (claims.MILLING, ("disc", 0.04), (0.5, 1000, 1.06)),
    (claims.MILLING, ("disc", 0.04), (0.978, 1000, 0.9)),
    (claims.ALIKE, 0.03, 0.1),
])  # fmt: skip
def test_a_wrong_number_is_found(monkeypatch, table, key, wrong):
    monkeypatch.setitem(table, key, wrong)
    assert not CLAIMS["milling" if table is claims.MILLING else "alike"](SEEDS).agrees


def test_two_samples_of_one_share_differ_as_often_as_they_should():
    # At 3.5 standard deviations in one of 2000 pairs; at 1.96 in one of 20.
    draws = np.random.default_rng(1).binomial(100, 0.7, (2000, 2)) / 100
    off = np.array([rows.off_by(a, 100, b, 100) for a, b in draws])
    assert 0.03 < (np.abs(off) > 1.96).mean() < 0.07
    assert (np.abs(off) > 3.5).mean() < 0.005


def test_the_interval_of_a_median_holds_it_as_often_as_it_says():
    draws = np.random.default_rng(2).normal(3, 1, (500, 101))
    made = [rows.median("", draw, None, margin=0) for draw in draws]
    assert 0.92 < np.mean([row.low <= 3 <= row.high for row in made]) < 0.99


def test_a_page_and_an_exit_code(tmp_path, capsys, monkeypatch):
    command = ["claims", "--only", "alike", "--seeds", "30", "--json", "--out", str(tmp_path / "a")]
    assert cli.run(command) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["agree"] and said["claims"][0]["name"] == "alike"
    ran = {part["shows"]: part["of"] for part in said["paper"] if part["of"]}
    assert set(ran.values()) == {len(said["claims"][0]["numbers"]) - 6}  # but the outer spreads
    page = (tmp_path / "a/index.html").read_text()
    assert all(part["shows"] in page for part in said["paper"])
    assert {path.name for path in (tmp_path / "a").iterdir()} == {
        "index.html", "claims.json", "alike_1.svg"}  # fmt: skip
    monkeypatch.setitem(claims.ALIKE, 0.03, 0.3)
    assert cli.run(["claims", "--only", "alike", "--seeds", "30"]) == 1
    with pytest.raises(ValueError, match="--only alik: must be one of milling"):
        cli.run(["claims", "--only", "alik"])
    with pytest.raises(typer.BadParameter, match="nan is no finite number"):
        cli.run(["claims", "--only", "bullseye", "--odd-turn", "nan"])


def test_snapshots_are_at_the_limits_that_were_published():
    """By the metrics of the twin's own swarms, written in C++ for velocities of the plant."""

    def measured(trace, name):
        step = np.diff(trace[-2:], axis=0) / pivot.STEP_S
        heading = trace[-1:, :, 2]
        ahead = step[..., 0] * np.cos(heading) + step[..., 1] * np.sin(heading)
        velocity = np.stack([ahead, np.zeros_like(ahead), step[..., 2]], axis=-1)
        (values,) = native.measure(trace[-1:], velocity, trace.shape[1], pivot.RANGE_M, 0.1)
        return values[native.METRICS.index(name)]

    for trace, rung in zip(pivot.mills(), pivot.CIRCLINESS, strict=True):
        assert measured(trace, "circliness") == pytest.approx(rung, rel=0.15)
    for trace, rung in zip(pivot.diffusings(), pivot.DELTA, strict=True):
        assert measured(trace, "diffusion") == pytest.approx(rung, abs=0.02)


def test_who_goes_straight_is_its_own_turning_centre():
    trace = np.array([[[0.0, 0, 0.3]], [[0.1, 0, 0.3]]])
    for sign in pivot.SIGNS.values():
        np.testing.assert_allclose(pivot._moving_centres(trace, 1.0, sign), [[[0.1, 0]]])


def test_every_claim_stands_for_a_part_of_the_paper():
    assert {name for part in paper.PARTS for name in part.claims} == {
        *CLAIMS, "bodies", "last_figure", "actuation", "process",
        "prediction_in_mujoco"}  # fmt: skip
    assert all(part.claims or part.elsewhere for part in paper.PARTS)


def test_what_distributions_have_in_common():
    """1 less the total variation; by hand: six runs and three in common."""
    seen = [Counter(milling=9, cluster=3)]
    assert fidelity._alike(seen, [Counter(milling=6, cluster=6)]) * fidelity.SEEDS == [9]


def test_what_is_added_comes_nearer_to_the_robot_and_then_to_its_swarms():
    """The truth is planted: a data sheet's robot, its bent duty table, its lag, camera and spread.

    Nested models lose on held-out data what noise is alone, true robots agree with themselves as
    two samples of one multinomial do, and no model agrees with them better than that.
    """
    claim = fidelity.fidelity(0)
    values = {row.what: row for row in claim.rows}

    def of(what: str) -> list[rows.Row]:
        return [row for name, row in values.items() if name.startswith(f"{what}, ")]

    numbers, errors = (
        [row.value for row in of(w)] for w in ("numbers measured", "error over its floor")
    )
    assert numbers[0] == 0 and all(b > a for a, b in pairwise(numbers))
    assert all(b <= 1.02 * a for a, b in pairwise(errors))
    assert errors[0] > 3 * errors[-1] and errors[-3] == errors[-1]  # no drive shows camera, spread
    alike = of("classes alike")[:-1]
    again = values["classes alike, true robots with other seeds"]
    assert len(alike) == len(errors) and again.low > alike[0].value
    errors_of_means = [(row.high - row.value) / 1.96 for row in (alike[-1], again)]
    assert abs(alike[-1].value - again.value) < 3.5 * np.hypot(*errors_of_means)


def test_true_robots_agree_with_themselves_as_samples_of_one_distribution_do(tmp_path):
    """Against NumPy's multinomial with the shares of both samples together."""
    model = tmp_path / "truth.toml"  # named and made as there, whose runs are these
    model.write_text(ModelFile.load("turbopi.toml").text + fidelity.COASTING)
    a, b = (fidelity._shares(model, first) for first in (1, 100_001))
    random, expected = np.random.default_rng(1), []
    for x, y in zip(a, b, strict=True):
        p = np.array([(x + y)[name] for name in sorted(x + y)]) / (2 * fidelity.SEEDS)
        one, other = random.multinomial(fidelity.SEEDS, p, (2, 2000))
        expected.append(np.minimum(one, other).sum(axis=1) / fidelity.SEEDS)
    ours, sums = fidelity._alike(a, b).mean(), np.mean(expected, axis=0)
    assert abs(ours - sums.mean()) < 3.5 * sums.std()


def test_the_four_steps_run_as_typed_and_find_what_was_planted(monkeypatch):
    """The last step in part: fewer models are drawn, and fewer runs made in MuJoCo."""
    *others, (last, (predict, score)) = process.STEPS.items()
    whole, part = "--cells 6 --repeats 2 --draws 20", "--cells 3 --repeats 1 --draws 5"
    assert whole in predict
    steps = {**dict(others), last: [predict.replace(whole, part), score]}
    monkeypatch.setattr(process, "STEPS", steps)
    claim = process.process(0)
    assert claim.agrees and claim.count == (1, 1)
    assert [title for title, _ in claim.transcript] == list(process.STEPS)
    for (_, printed), lines in zip(claim.transcript, process.STEPS.values(), strict=True):
        blocks = [block for block in printed.split("$ ") if block]
        assert [block.partition("\n")[0] for block in blocks] == lines
        assert all(block.partition("\n")[2].strip() for block in blocks)


def test_laboratories_in_mujoco_go_on_where_they_were(tmp_path, monkeypatch):
    monkeypatch.setattr(prediction, "SECONDS", 2.0)
    monkeypatch.setattr(prediction, "CELLS", 2)
    monkeypatch.setattr(prediction, "LABS", 3)
    request, said = prediction.sealed_prediction(tmp_path, prediction.BODIED)
    told, run_once = [], prediction.run_part

    def stops(*words):
        if len(told) == 1:
            raise KeyboardInterrupt
        return run_once(*words)

    def saw(tell=lambda done, of: told.append((done, of))):
        return prediction.laboratories_in_mujoco(request, said.points, tmp_path / "labs", tell)

    monkeypatch.setattr(prediction, "available_cores", lambda: 1)
    monkeypatch.setattr(prediction, "run_part", stops)
    with pytest.raises(KeyboardInterrupt):
        saw()
    monkeypatch.setattr(prediction, "run_part", run_once)
    broken_off = saw()
    assert told == [(1, 3), (2, 3), (3, 3)] and broken_off.shape == (3, 2)
    whole = prediction.laboratories_in_mujoco(
        request, said.points, tmp_path / "new", lambda done, of: None
    )
    np.testing.assert_array_equal(broken_off, whole)


def test_spread_of_measured_robots_is_told_at_each_input(tmp_path):
    """Four robots off by -30, -10, 10 and 30 % in a curve, and not at all straight."""
    lines = ["robot_id,speed_input,direction_deg,turn_input,run,speed_mps,turn_radps,note"]
    for robot, off in enumerate((-0.3, -0.1, 0.1, 0.3), 1):
        lines += [f"{robot},100,90,0,1,0.36,0,", f"{robot},100,90,0.5,1,{0.3 * (1 + off)},-0.5,"]
    (tmp_path / "sheet.csv").write_text("\n".join(lines) + "\n")
    claim = actuation(read_steady_tables(tmp_path / "sheet.csv"))
    spread = {row.what.partition(": ")[2]: row for row in claim.rows if "speed, 4" in row.what}
    assert spread["input 100, 90 degrees"].value == pytest.approx(0, abs=1e-9)
    expected = np.std([-0.3, -0.1, 0.1, 0.3], ddof=1)
    assert spread["input 100, 90 degrees, turn 0.5"].value == pytest.approx(expected)
    # The paper's factors as facts have them, recomputed from its means: 0.037 over six values.
    alone = actuation([])
    for told in (claim, alone):
        assert told.agrees and any(row.value == pytest.approx(0.037, abs=5e-4) for row in told.rows)
    assert len(alone.rows) < len(claim.rows) and "(actuation)" in alone.finding


def test_maps_in_mujoco_are_kept_and_no_two_of_their_runs_share_a_seed(tmp_path, monkeypatch):
    monkeypatch.setattr(bodies, "MAP", ["v_mps=0.2,0.3"])
    monkeypatch.setattr(bodies, "SECONDS", 0.5)
    asked = bodies.layers(5)
    assert [(kind, request.seeds) for kind, request in asked[::3]] == [
        ("robot", 2), ("robot", 2), ("robot", 1)]  # fmt: skip
    seeds = [s for _, r in asked for s in r.seed_of(np.arange(r.world_count))]
    assert sorted(seeds) == list(range(1, 31))  # 2 cells, 3 kinds, 5 seeds: each seed once
    told = []
    for count in (1, 1, 3):
        asked = [request for _, request in bodies.layers(count)]
        run_kept(asked, tmp_path, lambda done, of: told.append((done, of)))
    assert told[-1] == (18, 18)
    changed = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/sweep.parquet")}
    claim = bodies.bodies(3, tmp_path)
    assert changed == {path: path.stat().st_mtime_ns for path in changed}
    assert len(changed) == 9  # of one seed, of two and of the one after them, three kinds each
    assert len(claim.rows) == 6 and "of 2 cells differ" in claim.finding


def test_swarms_of_the_last_figure_are_counted_in_both_plants(tmp_path, monkeypatch):
    """Planar ones as the reference has them: 99, 100 and 99 %, an odd robot at 0.76 of it."""
    planar = {"planar": last_figure.PLANTS["planar"]}
    monkeypatch.setattr(last_figure, "PLANTS", planar)
    monkeypatch.setattr(last_figure, "_figure", lambda: None)
    run_kept(last_figure.requests(20), tmp_path, lambda done, of: None)
    claim = last_figure.last_figure(20, tmp_path)
    found = {row.what: row for row in claim.rows}
    for name in ("milling", "diffusing", "odd robot, -3 times", "odd robot, +3 times"):
        assert found[f"{name}, planar"].value >= 0.85
    orbit = found["odd robot, -3 times, planar: its distance over the ring's radius"]
    assert orbit.value == pytest.approx(0.76, abs=0.04)


def test_a_number_that_differs_is_named_with_why():
    good = rows.Row("a", 1, 1, 1, (1, 1), True)
    known = rows.Row("b", 1, 1, 1, (2, 2), False, "+9 standard deviations", known="a reason")
    strange = rows.Row("c", 1, 1, 1, (2, 2), False, "+9 standard deviations")
    claim = rows.Claim("bullseye", "so", "", False, "", [good, known, strange], [])
    (answer,) = [a for a in paper.answers([claim]) if a.of]
    assert (answer.agree, answer.of, answer.found) == (1, 3, "not seen: so")
    assert answer.differs == ["b: a reason", "c: not known why (+9 standard deviations)"]


def literally(n: int, seeds: int, spread: float = 0.04) -> float:
    """Share of mills by the published equations, exact arcs, written once more in NumPy."""
    random, dt_s, half_rad = np.random.default_rng(1), 0.022, np.radians(49) / 2
    z = random.uniform(-0.6, 0.6, (seeds, n)) + 1j * random.uniform(-0.6, 0.6, (seeds, n))
    heading = random.uniform(-np.pi, np.pi, (seeds, n))
    speed, turn = random.normal(1, spread, (2, seeds, n)) * [[[0.25]], [[np.radians(45)]]] * dt_s
    last, steps = [], int(120 / dt_s)
    for k in range(steps):
        ahead = (z[:, None, :] - z[:, :, None]) * np.exp(-1j * heading)[:, :, None]
        size = np.abs(ahead)
        seen = ((size < 1.1) & (size > 0) & (ahead.real > np.cos(half_rad) * size)).any(axis=2)
        by = np.where(seen, turn, -turn)
        z = z + speed * np.exp(1j * (heading + by / 2))
        heading = heading + by
        if k * dt_s >= 110:
            r = np.abs(z - z.mean(axis=1, keepdims=True))
            last.append((r.max(axis=1) - r.min(axis=1)) / r.min(axis=1))
    return float((np.mean(last, axis=0) < 0.2).mean())


def test_where_we_differ_from_the_reference_the_equations_are_with_us():
    for kind, n in claims.KNOWN_MORE:
        assert kind == "point"
        ours = run([f"n={n}"], seeds=400).mills.mean()
        assert abs(rows.off_by(ours, 400, literally(n, 80), 80)) < 3.5


def test_round_is_a_mill_by_both_criteria():
    runs = run(["v_mps=0.25", "omega_degps=45", *KINDS["disc"]])
    assert (runs["class"] == "milling").mean() == pytest.approx(runs.mills.mean(), abs=0.02)


def test_bodies_in_contact_are_no_mill_however_round():
    # At 0.1 m/s and 40 deg/s and more the reference's mills are six bodies in contact on 0.2 m.
    runs = run(["v_mps=0.1", "omega_degps=60", *KINDS["robot"]])
    assert runs.mills.mean() > 0.9
    assert np.median(runs["radius_m"]) == pytest.approx(0.2, abs=0.01)
    assert (runs["class"] == "jammed").mean() > 0.9


def test_intervals_of_a_spread_hold_what_they_promise():
    """Intervals of 3000 samples of four robots hold their true spread in 95 %.

    One that is symmetric about the sample's, by the formula of large samples, holds it in 80 %.
    """
    random, held = np.random.default_rng(1), 0
    for _ in range(3000):
        low, high = _spread_interval(float(random.normal(0, 0.04, 4).std(ddof=1)), 4)
        held += low <= 0.04 <= high
    assert abs(held / 3000 - 0.95) < 3.5 * np.sqrt(0.05 * 0.95 / 3000)


def test_the_table_of_speeds_is_a_claim_like_the_others(capsys):
    cli.run(["claims", "--only", "actuation", "--json"])
    (only,) = json.loads(capsys.readouterr().out)["claims"]
    assert only["name"] == "actuation" and only["agrees"]
