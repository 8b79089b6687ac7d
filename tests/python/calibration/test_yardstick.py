# SPDX-License-Identifier: Apache-2.0
"""A right model scores one, whatever its effects, and one without them more.

Truth: robots of the twin without spread, each with one effect of the catalogue at its card's size.
"""

import pytest
import twinmill_native as native

import twinmill as tm
from twinmill.experiment.rich_script import write_rich_script

DURATION_S = 90
SEEDS = (1, 2, 3)
CARDS = {card["name"]: card for card in native.catalogue()}
OF_OTHERS = {"acceleration_limit", "speed_limit", "wheel_limit"}  # robots told velocities
SHOWN = [n for n, card in CARDS.items() if card["needs"] != "contacts" and n not in OF_OTHERS]
FEW = ("slew_limit", "coasting", "floor_patch", "yaw_lag")  # of which a regression knows little


def with_effects(*names: str) -> str:
    """Text of a TurboPi's model with effects of usual size."""
    tables = [
        "\n".join([f'[[effect]]\nname = "{n}"', *(f"{p['name']} = {p['default']}" for p in
                   CARDS[n]["parameters"])])
        for n in names
    ]  # fmt: skip
    return "\n\n".join([tm.Model.load("turbopi.toml").file.text, *tables, ""])


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A log of such a robot on a rich drive, and its model."""

    def drive(*names: str, seed: int = 1):
        folder = tmp_path_factory.mktemp("driven")
        script, path = folder / "script.csv", folder / "true.toml"
        write_rich_script(str(script), DURATION_S, seed)
        path.write_text(with_effects(*names))
        model = tm.Model.load(path)
        log = tm.simulate(
            model, n=1, duration_s=DURATION_S, alike=True, script=str(script), seed=seed
        )
        return log, model

    return drive


def judge(driven, name: str, seed: int) -> None:
    """90 s have some 45 independent errors over 2 s: 95 % of right models score 0.93 to 1.07."""
    log, true = driven(name, seed=seed)
    score = tm.compare(log, true).score
    assert 0.9 < score < 1.1
    assert tm.compare(log, tm.Model.load("turbopi.toml")).score > score - 0.05


@pytest.mark.parametrize("name", FEW)
def test_a_right_model_scores_one(driven, name):
    judge(driven, name, 1)


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", SHOWN)
def test_a_right_model_scores_one_with_any_effect(driven, name, seed):
    judge(driven, name, seed)


def test_comparison_and_diagnosis_say_the_same_of_one_log_and_model(driven):
    log, true = driven("slew_limit")
    bare = tm.Model.load("turbopi.toml")
    missed, right = tm.compare(log, bare), tm.compare(log, true)
    assert missed.verdict.startswith("Something is missing")
    assert right.verdict.startswith("As good as this log can tell")
    assert [f.effect for f in tm.diagnose(log, bare).found if f.certainty == "sure"] == [
        "slew_limit"
    ]
    assert not [f for f in tm.diagnose(log, true).found if f.certainty == "sure"]


@pytest.mark.parametrize("first", ["slew_limit", "coasting", "floor_patch"])
def test_a_second_effect_beside_one_is_found(driven, first):
    log, _ = driven(first, "marker_offset")
    found = tm.diagnose(log, tm.Model.load("turbopi.toml"))
    assert {f.effect for f in found.found} == {first, "marker_offset"}
