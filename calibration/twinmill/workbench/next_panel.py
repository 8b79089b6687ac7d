# SPDX-License-Identifier: Apache-2.0
"""The panel of the next run: time and floor, the run that tells most, its script."""

from pathlib import Path

from nicegui import ui

from twinmill.experiment.power import percent
from twinmill.files import replacing
from twinmill.workbench.panel import PageActions, check_free, commands_html, escaped, markup

FLOOR_PX = 300  # the longer side of the floor, as drawn


class NextPanel:
    """Asks for time and floor, draws the run."""

    def __init__(self, page: PageActions) -> None:
        self.page, self.bench = page, page.bench
        ui.label(
            "The run that best tells apart what these logs leave open, as the command twinmill "
            "next designs it."
        ).classes("soft")
        with ui.element("div").classes("buttons"):
            asked = self.bench.view.get("next", {})
            self.duration_s = _number("time (s)", asked.get("duration_s", 30), "next-duration")
            self.along_m = _number("floor (m)", asked.get("along_m", 2), "next-along")
            self.across_m = _number("by (m)", asked.get("across_m", 2), "next-across")
            self.duty_pct = _number("duty (%)", asked.get("duty_pct", 100), "next-duty")
        with ui.element("div").classes("buttons"):
            self.button = ui.button("Design", on_click=self.design)
            self.button.props('dense unelevated no-caps padding="2px 16px" data-testid="design"')
            self.progress = ui.label().classes("soft").style("flex: 1")
        self.failure = ui.label().classes("note wrong")
        self.body = ui.element("div").classes("stack").props('data-testid="plan"')
        self.draw_progress()

    async def design(self) -> None:
        """Asks for the run."""
        asked = {
            "duration_s": self.duration_s.value,
            "along_m": self.along_m.value,
            "across_m": self.across_m.value,
            "duty_pct": self.duty_pct.value,
        }
        if any(value is None for value in asked.values()):
            ui.notify("Give time, floor and duty as numbers.", type="warning")
            return
        self.bench.view["next"] = asked
        await self.page.start("next", options=asked)

    def draw_progress(self) -> None:
        """Shows the work under way, or the reason why there is none."""
        doing = self.bench.doing
        self.button.set_visibility(doing is None)
        self.button.set_enabled(self.bench.ready)
        self.progress.set_text(self.bench.progress if doing else "")
        self.failure.set_text(self.bench.failure)
        self.failure.set_visibility(bool(self.bench.failure))

    def draw(self) -> None:
        """The run that was designed last."""
        self.body.clear()
        plan = self.bench.session.plan
        self.draw_progress()
        if plan is None:
            return
        with self.body:
            good = "good" if plan["predicted_power"] > 0.5 else "warn"
            markup(
                "{} <b class={}>The right name comes with a chance of {}</b>, in {} s.",
                plan["why"],
                good,
                percent(plan["predicted_power"]),
                f"{plan['end_s']:.1f}",
            ).classes("note said")
            ui.echart(_floor(plan)).style(f"height: {_height_px(plan) + 56}px").props(
                'data-testid="plan-floor"'
            )
            self._effects(plan)
            self._save(plan)

    def _effects(self, plan: dict) -> None:
        rows = [escaped("<div>effect</div><div>so far</div><div>then</div>")]
        for effect in plan["effects"]:
            tone = "good" if effect["power"] > 0.5 else "warn"
            rows.append(
                escaped(
                    '<div>{}</div><div>{}</div><div class="{}">{}</div>',
                    effect["effect"],
                    percent(effect["power_before"]),
                    tone,
                    percent(effect["power"]),
                )
            )
        ui.label("Chance that each is named, if it is the one:").classes("soft")
        for k, row in enumerate(rows):
            markup("{}", row).classes("model head" if k == 0 else "model still")

    def _save(self, plan: dict) -> None:
        with ui.element("div").classes("buttons"):
            path = ui.input("Save script as", value="script.csv")
            path.props('dense outlined data-testid="script-as"').style("flex: 1")
            button = ui.button("Save", on_click=lambda: _written(plan, path.value))
            button.props('dense unelevated no-caps padding="4px 16px" data-testid="save-script"')
        ui.label("The same from a terminal, and what to do then:").classes("soft")
        markup("{}", commands_html(plan["commands"])).props('data-testid="next-commands"')


def _number(label: str, value: float, name: str) -> ui.number:
    return (
        ui.number(label, value=value)
        .props(f'dense outlined data-testid="{name}"')
        .style("width: 80px")
    )


def _written(plan: dict, path: str) -> None:
    path = (path or "").strip() or "script.csv"
    try:
        check_free(Path(path))
        with replacing(Path(path), force=None) as temporary:
            temporary.write_text(plan["script"])
    except ValueError as error:
        ui.notify(str(error), type="negative")
        return
    ui.notify(f"Written: {path}", type="positive")


def _height_px(plan: dict) -> float:
    along_m, across_m = plan["floor_m"]
    return FLOOR_PX * min(1.0, across_m / along_m)


def _floor(plan: dict) -> dict:
    """The predicted path on the floor: as the model is, and with each effect in question."""
    along_m, across_m = (0.5 * side for side in plan["floor_m"])
    corners = [(-along_m, -across_m), (along_m, -across_m), (along_m, across_m)]
    corners += [(-along_m, across_m), corners[0]]
    width_px = _height_px(plan) * along_m / across_m

    def line(name: str, points: list, color: str, width: float) -> dict:
        style = {"color": color, "width": width}
        return {
            "type": "line",
            "name": name,
            "data": points,
            "lineStyle": style,
            "itemStyle": {"color": color},
            "symbol": "none",
        }

    others = plan["paths"][1:]
    lines = [line("floor", corners, "#3c3c3c", 1.5)]
    lines += [line("with an effect", path, "#d55e00", 1) for path in others]
    lines += [line("as the model is", plan["paths"][0], "#0072b2", 2.5)]  # above the others
    start = {"type": "scatter", "name": "start", "data": [[0, 0]], "symbolSize": 9}
    start["itemStyle"] = {"color": "#3c3c3c"}
    axis = {"type": "value", "splitLine": {"show": False}, "axisLine": {"onZero": False}}
    names = ["as the model is", *(["with an effect"] if others else []), "start"]
    return {
        "animation": False,
        "legend": {"top": 0, "data": names},
        "grid": {"left": 34, "top": 26, "width": width_px, "height": _height_px(plan)},
        "xAxis": {**axis, "min": -along_m, "max": along_m},
        "yAxis": {**axis, "min": -across_m, "max": across_m},
        "series": [*lines, start],
    }
