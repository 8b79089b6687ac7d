# SPDX-License-Identifier: Apache-2.0
"""The workbench in a real browser, by clicks alone: its numbers and files are the commands'."""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from playwright.sync_api import expect

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.programs import find_program
from twinmill.report.tables import number
from twinmill.workbench.swarm import EVERY
from twinmill_cli import main as cli

LONG_S = 40.0  # of the real recording: two pairs of runs
SWARM, SWARM_S = 4, 15  # robots and seconds in the twin
ARROWS = """(count) => {
    for (let k = 0; k < count; k++) {
        const key = { key: "ArrowRight", keyCode: 39, bubbles: true, cancelable: true };
        for (const type of ["keydown", "keyup"]) {
            document.activeElement.dispatchEvent(new KeyboardEvent(type, key));
        }
    }
}"""  # at once, however busy the machine is: after a rest the next key begins another model


@contextmanager
def workbench(*arguments, ends_with=0):
    """The command as a user starts it; its address."""
    command = [sys.executable, "-m", "twinmill_cli.main", "open", "run.lcmlog", "--no-browser"]
    command += ["--state", "state.json", *arguments]
    # NiceGUI behaves otherwise where it finds itself in a test.
    alone = {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=alone)
    try:
        words = server.stdout.readline()
        yield re.search(r"http\S+", words)[0]
    finally:
        if ends_with == 0:
            server.send_signal(signal.SIGINT)
        server.stdout.close()
        assert server.wait(60) == ends_with


def is_predicted(page) -> None:
    page.wait_for_function("document.body.dataset.predicted !== undefined")
    expect(page.get_by_test_id("score")).to_have_text(re.compile(r"\d"))


def exact(page, row: int) -> str:
    """The score of a model once the worker has it, without the sign of an estimate."""
    model = page.get_by_test_id(f"model-{row}")
    expect(model).not_to_contain_text("≈")
    return model.locator("div").nth(1).text_content()


def drawn_mm(page) -> float:
    """Root mean square of the position errors that are drawn, half a second ahead."""
    errors = "twinmill.prediction.arrays.errors"
    values = page.evaluate(f"Array.from({errors}.data)")
    width = page.evaluate(f"{errors}.width")
    column = np.array(values, float).reshape(-1, width)[:, 1]
    return 1000 * float(np.sqrt(np.nanmean(column**2)))


# -- one real robot -------------------------------------------------------------------------------


@pytest.fixture
def import_turbopi(data_dir, tmp_path, monkeypatch) -> Callable[[float], None]:
    """Makes a log of a part of the real robot's recording, in the working directory."""
    folder = data_dir / "turbopi_optitrack_straight"
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}")
    for name in ("poses", "commands"):
        table = pd.read_csv(folder / f"{name}.csv", dtype=str)
        table[table.t_s.astype(float) < LONG_S].to_csv(tmp_path / f"{name}.csv", index=False)
    tables = tmp_path / "poses.csv", tmp_path / "commands.csv"
    monkeypatch.chdir(tmp_path)

    def make(heading_offset_rad: float) -> None:
        options = ImportOptions(heading_offset_rad=heading_offset_rad)
        import_log(*tables, tmp_path / "run.lcmlog", options=options)

    return make


def test_why_a_log_cannot_be_opened_is_said_in_the_page(import_turbopi, page):
    """As recorded, the tracked body looks backwards."""
    import_turbopi(0.0)
    with workbench(ends_with=1) as url:
        page.goto(url)
        expect(page.locator("#failed")).to_contain_text(
            re.compile(r"--heading-offset-deg=-1(79|80)\b")
        )
        page.wait_for_function("document.getElementById('popup').ariaHidden === 'false'")
        # "Nothing is lost" would be wrong: nothing was opened.
        expect(page.get_by_text("The workbench does not answer.")).not_to_be_visible()


def test_the_whole_conversation(import_turbopi, page):
    import_turbopi(np.pi)
    with workbench() as url:
        assert page.request.get(url.split("?")[0]).status == 403
        assert page.request.get(f"{url.split('?')[0]}data/log?log=0&token=wrong").status == 403
        socket = "_nicegui_ws/socket.io/?EIO=4&transport=polling"
        assert page.request.get(url.split("?")[0] + socket).status == 403
        nowhere = page.request.get(url.replace("/?", "/nowhere?"))
        assert nowhere.status == 404
        assert "address" in nowhere.text() and "NiceGUI" not in nowhere.text()
        page.goto(url)
        is_predicted(page)
        a_hint_leaves_the_panel_free(page)
        shown = page.get_by_test_id("score")
        expect(shown).to_have_text(re.compile(r"^\d"))  # the checks of the commands are made
        given = shown.text_content()
        turn_a_knob_and_back(page, given)
        find_where_it_fails(page)
        missed_mm = drawn_mm(page)
        name_coasting(page)
        plan_the_next_run(page)
        add_coasting(page)
        expect(shown).not_to_contain_text("≈")
        assert drawn_mm(page) < 0.6 * missed_mm
        added = save_and_repeat(page, given)
        run_the_twin(page)

        # A reload loses nothing, nor does a server that was stopped.
        page.reload()
        page.get_by_test_id("tab-models").click()
        expect(page.get_by_test_id("model-2")).to_have_class(re.compile("now"))
    expect(page.get_by_text("The same command goes on where you were")).to_be_visible()
    keep_a_group()
    with workbench() as url:
        # The session is the same at its new address.
        page.goto(url)
        expect(page.get_by_text("The same command goes on where you were")).not_to_be_visible()
        page.get_by_test_id("tab-models").click()
        expect(page.get_by_test_id("model-2")).to_have_class(re.compile("now"))
        assert exact(page, 2) == added
        page.get_by_test_id("tab-swarm").click()
        expect(page.get_by_test_id("swarm-table")).to_contain_text("circliness")
        expect(page.locator("#swarm")).not_to_be_visible()  # poses are not kept
        ask_for_the_drive_that_parts(page)


def keep_a_group() -> None:
    """Puts a rival beside what was found: whether these logs have one is for the diagnosis."""
    kept = json.loads(Path("state.json").read_text())
    kept["session"]["diagnosis"]["findings"][0]["group"] = ["coasting", "slew_limit"]
    Path("state.json").write_text(json.dumps(kept))


def ask_for_the_drive_that_parts(page) -> None:
    """By keys alone: the button designs a run, in its own panel."""
    page.get_by_test_id("tab-models").focus()
    while page.evaluate("document.activeElement.dataset.testid") != "tab-missing":
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    button = page.get_by_test_id("part-them").and_(page.locator(":enabled"))
    button.focus()
    for key in "zy":  # the panel is drawn anew
        before = button.element_handle()
        page.keyboard.press(key)
        before.wait_for_element_state("hidden")
        button.wait_for()
        expect(button).to_be_focused()
    status = page.get_by_test_id("status")
    expect(status).to_contain_text("turbopi-2.toml")  # what it was doing is done, and drawn
    expect(button).to_be_focused()
    page.keyboard.press("Enter")
    expect(status).to_contain_text("Designing a run")
    expect(page.get_by_test_id("design")).to_have_count(1)
    page.get_by_test_id("cancel").focus()
    page.keyboard.press(" ")
    expect(page.get_by_test_id("cancel")).not_to_be_visible()


def a_hint_leaves_the_panel_free(page) -> None:
    page.get_by_test_id("tab-models").hover()
    page.locator(".q-tooltip").wait_for()
    hint, tabs = (page.locator(at).bounding_box() for at in (".q-tooltip", ".q-tabs"))
    assert hint["y"] + hint["height"] <= tabs["y"] + tabs["height"]
    page.mouse.move(0, 0)
    page.locator(".q-tooltip").wait_for(state="detached")


def turn_a_knob_and_back(page, given: str) -> None:
    """The error rises; undone, all is as before. One quantity is held from then on."""
    shown = page.get_by_test_id("score")
    slider = page.get_by_test_id("knob-base.motor_lag_s").locator(".q-slider__track-container")
    box = slider.bounding_box()
    slider.click(position={"x": 0.95 * box["width"], "y": box["height"] / 2})
    expect(shown).not_to_have_text(given)
    page.get_by_test_id("undo").and_(page.locator(":enabled")).wait_for()
    turned = shown.text_content()
    page.keyboard.press("z")
    expect(shown).to_have_text(given)
    page.get_by_test_id("redo").click()
    expect(shown).to_have_text(re.compile(re.escape(turned.strip("≈ "))))
    page.get_by_test_id("undo").click()
    expect(shown).to_have_text(given)
    for name, clicks in (("sideways_gain", 1), ("yaw_gain", 2)):  # held; held and freed again
        lock = page.get_by_test_id(f"knob-base.{name}").locator(".lock")
        for k in range(clicks):
            lock.click()
            expect(lock).to_have_attribute("aria-pressed", "false" if k else "true")


def find_where_it_fails(page) -> None:
    """A click on a regime marks its moments and moves the cursor."""
    page.get_by_test_id("tab-fails").click()
    chart = page.get_by_test_id("regimes").locator("canvas").first
    chart.wait_for()
    chart.click(position={"x": 132, "y": 6 + 0.5 * 21}, force=True)
    page.wait_for_function("twinmill.marks.length > 0 && twinmill.t > 0")
    # The same by keys alone.
    page.locator("#marks").click()
    page.wait_for_function("twinmill.marks.length === 0")
    page.get_by_test_id("regime").get_by_role("combobox").focus()
    for key in ("Enter", "ArrowDown", "Enter"):
        page.keyboard.press(key)
    page.wait_for_function("twinmill.marks.length > 0")


def name_coasting(page) -> None:
    """Diagnosed, after a change of mind; and seen beside the model."""
    page.get_by_test_id("tab-missing").click()
    page.get_by_test_id("diagnose").click()
    page.get_by_test_id("cancel").click()
    page.get_by_test_id("diagnose").and_(page.locator(":enabled")).click()
    page.get_by_test_id("finding-coasting").wait_for()
    page.get_by_test_id("show-coasting").click()
    expect(page.get_by_test_id("beside")).to_contain_text(
        re.compile(r"with coasting, score ≈ (1\.|0\.[89])")
    )
    page.wait_for_function("document.body.dataset.beside === 'with coasting'")
    page.locator("#beside").click()
    page.wait_for_function("document.body.dataset.beside === ''")


def add_coasting(page) -> None:
    """After a change of mind: cancelled, all is as before."""
    page.get_by_test_id("tab-missing").click()
    shown = page.get_by_test_id("score")
    before = shown.text_content()
    page.get_by_test_id("add-coasting").click()
    page.wait_for_function("document.body.dataset.beside === 'before'")  # the first answer
    page.get_by_test_id("cancel").click()
    page.wait_for_function("document.body.dataset.beside === ''")
    expect(shown).to_have_text(before)
    page.get_by_test_id("add-coasting").and_(page.locator(":enabled")).click()
    page.get_by_test_id("tab-models").click()
    page.get_by_test_id("model-2").wait_for()


def plan_the_next_run(page) -> None:
    """The script that is saved is the command's."""
    page.get_by_test_id("tab-next").click()
    page.get_by_test_id("design").and_(page.locator(":enabled")).click()
    page.get_by_test_id("plan-floor").locator("canvas").wait_for()
    page.get_by_test_id("script-as").fill("mine.csv")
    page.get_by_test_id("save-script").click()
    page.noticed("Written: mine.csv")
    commands = page.get_by_test_id("next-commands").text_content().strip().splitlines()
    cli.run(shlex.split(commands[0])[1:])
    assert Path("mine.csv").read_bytes() == Path("script.csv").read_bytes()


def run_the_twin(page) -> None:
    """The swarm's class with the model now is that of `twin_run` and `metrics`."""
    page.get_by_test_id("tab-swarm").click()
    expect(page.locator("#swarm")).not_to_be_visible()  # nothing to be seen yet
    page.get_by_test_id("swarm-n").fill(str(SWARM))
    page.get_by_test_id("swarm-duration").fill(str(SWARM_S))
    page.get_by_test_id("run-twin").and_(page.locator(":enabled")).click()
    expect(page.get_by_test_id("swarm-table")).to_contain_text("circliness")
    page.get_by_test_id("diagram").locator("canvas").wait_for()
    expect(page.locator("#swarm")).to_be_visible()
    commands = page.get_by_test_id("swarm-commands").text_content().strip().splitlines()
    words = shlex.split(commands[-2])
    shutil.copy("mine.toml", words[words.index("--model") + 1])  # as its command writes it
    subprocess.run([str(find_program(words[0])), *words[1:]], check=True, capture_output=True)
    series = cli.run(shlex.split(commands[-1])[1:])
    drawn = page.evaluate(f"Array.from(twinmill.swarm.arrays.pose1.data.slice(-{3 * SWARM}))")
    np.testing.assert_allclose(np.reshape(drawn, (SWARM, 3)), series.pose[::EVERY][-1], atol=1e-5)


def save_and_repeat(page, given: str) -> str:
    """The file that is saved is the commands', and so are the scores."""
    added = exact(page, 2)
    page.get_by_test_id("save-as").fill("mine.toml")
    page.get_by_test_id("save").click()
    page.noticed("Written: mine.toml")
    commands = page.get_by_test_id("commands").text_content().strip().splitlines()
    mine = Path("mine.toml").read_bytes()
    os.remove("mine.toml")
    results = [cli.run(shlex.split(command)[1:]) for command in commands]
    assert Path("mine.toml").read_bytes() == mine
    assert re.findall(r"--hold (\S+)", commands[-1]) == ["base.sideways_gain"]
    assert added == number(results[-1].after.score)
    assert given == number(results[-1].before.score)
    return added


# -- four robots ----------------------------------------------------------------------------------


@pytest.fixture
def fleet(data_dir, tmp_path, monkeypatch) -> Path:
    """Four robots, of which R03 has weak left wheels: its README."""
    folder = data_dir / "fleet_weak_left"
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}")
    tables = folder / "sorted_poses.csv.gz", folder / "sorted_commands.csv.gz"
    import_log(*tables, tmp_path / "run.lcmlog", options=ImportOptions(same_clock=True))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_weak_robot_is_named(fleet, page):
    with workbench() as url:
        page.goto(url)
        is_predicted(page)
        page.wait_for_function("twinmill.robot.name === 'R03'")  # which the model misses most
        the_robot_picked_last_is_shown(page)
        type_a_number(page)
        turn_by_keys(page)
        diagnose_by_keys(page)
        told = page.get_by_test_id("findings")
        expect(told).to_contain_text(re.compile(r"R03: .*wheel_gain"))
        page.get_by_test_id("robot").click()
        page.get_by_role("option", name=re.compile("^R01")).click()
        page.wait_for_function("twinmill.robot.name === 'R01'")
        give_the_robot_its_own(page)


def the_robot_picked_last_is_shown(page) -> None:
    """Also where the server's answer on the one picked before comes after."""
    late, first = [], re.compile(r"/data/robot\?index=0&")
    page.route(first, lambda route: late.append(route))
    page.evaluate("twinmill.source.ask('run.lcmlog R01')")
    while not late:
        page.wait_for_timeout(20)
    page.evaluate("twinmill.source.ask('run.lcmlog R02')")
    page.wait_for_function("twinmill.robot.name === 'R02'")
    with page.expect_response(first):
        late[0].continue_()
    page.wait_for_timeout(500)  # in which it would be drawn
    assert page.evaluate("twinmill.robot.name") == "R02"
    page.unroute(first)
    page.evaluate("twinmill.source.ask('run.lcmlog R03')")
    page.wait_for_function("twinmill.robot.name === 'R03'")


def diagnose_by_keys(page) -> None:
    """The button that was pressed has the focus again, once it is there again."""
    page.get_by_test_id("tab-missing").click()
    button = page.get_by_test_id("diagnose").and_(page.locator(":enabled"))
    button.focus()
    page.keyboard.press("Enter")
    expect(page.get_by_test_id("diagnose")).not_to_be_visible()
    expect(button).to_be_focused()


def give_the_robot_its_own(page) -> None:
    """The weak robot is shown, and the model with its wheels is that of the command."""
    page.get_by_test_id("show-wheel_gain-R03").click()
    page.wait_for_function("twinmill.robot.name === 'R03'")
    page.wait_for_function("document.body.dataset.beside === 'with wheel_gain of R03'")
    page.get_by_test_id("add-wheel_gain-R03").and_(page.locator(":enabled")).click()
    page.get_by_test_id("tab-models").click()
    row = page.locator("[data-testid^=model-].now").filter(has_text="wheel_gain of R03")
    expect(row).not_to_contain_text("≈")
    page.get_by_test_id("save-as").fill("mine.toml")
    page.get_by_test_id("save").click()
    page.noticed("Written: mine.toml")
    told = page.get_by_test_id("commands").text_content().strip().splitlines()
    assert len(told) == 1, told
    (command,) = told
    mine = Path("mine.toml").read_bytes()
    os.remove("mine.toml")
    result = cli.run(shlex.split(command)[1:])
    assert Path("mine.toml").read_bytes() == mine
    scores = [row.locator("div").nth(k).text_content() for k in (1, 2)]
    assert scores == [number(result.after.score), number(result.heldout_after.score)]


def type_a_number(page) -> None:
    """Typed numbers are taken, also after an undo, within their bounds; Escape takes nothing."""
    shown = page.get_by_test_id("score")
    expect(shown).to_have_text(re.compile(r"^\d"))
    given = shown.text_content()
    number = page.get_by_test_id("knob-base.motor_lag_s").locator("input.number")
    before = number.input_value()
    for _ in range(2):
        number.fill("0.1")
        number.press("Enter")
        expect(shown).not_to_have_text(given)
        number.blur()
        page.keyboard.press("z")
        expect(number).to_have_value(before)
        expect(shown).to_have_text(given)
    number.fill("99")
    number.press("Enter")
    page.noticed("99: must be within")
    page.get_by_test_id("undo").click()
    expect(number).to_have_value(before)
    number.fill("0.1")
    number.press("Escape")
    expect(number).to_have_value(before)
    expect(shown).to_have_text(given)


def turn_by_keys(page) -> None:
    """Several keys in a row make one model: one undo takes them back."""
    knob = page.get_by_test_id("knob-base.yaw_gain")
    number = knob.locator("input.number")
    before = number.input_value()
    knob.locator("[tabindex].q-slider__track-container").focus()
    page.evaluate(ARROWS, 4)
    expect(number).not_to_have_value(before)
    page.get_by_test_id("undo").and_(page.locator(":enabled")).click()
    expect(number).to_have_value(before)
