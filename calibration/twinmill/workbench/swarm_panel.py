# SPDX-License-Identifier: Apache-2.0
"""The panel of the swarm: the twin with the model as given and with the model now, side by side."""

from nicegui import ui

from twinmill.swarm.classes import COLORS
from twinmill.workbench.panel import PageActions, commands_html, markup, scored
from twinmill.workbench.swarm import STARTS, has_poses

AXIS = {
    "nameLocation": "middle",
    "splitLine": {"show": False},
    "axisLabel": {"fontSize": 11, "showMinLabel": False, "showMaxLabel": False},
}
WAITING = (
    "Shown then: the swarm with the model as given and with the model now, from above, side by "
    "side; how many of {} starts end in which behaviour; and where both models lie on the phase "
    "diagram of speed and turn rate."
)
CELL_PX = (31, 21)
LEAST = 1e-3  # m/s or rad/s, below which nothing moves
SHOWN = ("circliness", "radius_m", "rotation", "groups", "contacts")
KEPT = "Run the twin once more to see the swarms from above; their numbers were kept."


class SwarmPanel:
    """Runs the twin and shows what its swarms do."""

    def __init__(self, page: PageActions) -> None:
        self.page, self.bench = page, page.bench
        asked = self.bench.view.get("swarm", {})
        ui.label("What a swarm would do: the same starts with both models.").classes("soft")
        with ui.element("div").classes("buttons"):
            self.n = ui.number("robots", value=asked.get("n", 8), min=2, max=100, precision=0)
            self.n.props('dense outlined data-testid="swarm-n"').style("width: 78px")
            self.duration_s = ui.number("time (s)", value=asked.get("duration_s", 60), min=10)
            self.duration_s.props('dense outlined data-testid="swarm-duration"').style(
                "width: 78px"
            )
            self.behavior = ui.input("behaviour", value=asked.get("behavior", "milling_cmaes"))
            self.behavior.props("dense outlined").style("flex: 1; min-width: 130px")
        with ui.element("div").classes("buttons"):
            self.button = ui.button("Run the twin", on_click=self.run)
            self.button.props('dense unelevated no-caps padding="2px 16px" data-testid="run-twin"')
            self.progress = ui.label().classes("soft").style("flex: 1")
        self.failure = ui.label().classes("note wrong")
        self.waiting = ui.label(WAITING.format(STARTS)).classes("soft")
        self.sheet = markup('<canvas id="swarm"></canvas>')
        self.sheet.classes("sheet swarm")
        self.body = ui.element("div").classes("stack").props('data-testid="swarm-table"')
        self.draw_progress()

    async def run(self) -> None:
        """Starts the twin."""
        if None in (self.n.value, self.duration_s.value) or not self.behavior.value:
            ui.notify("Give robots, time and behaviour.", type="warning")
            return
        asked = {
            "n": int(self.n.value),
            "duration_s": self.duration_s.value,
            "behavior": self.behavior.value,
        }
        self.bench.view["swarm"] = asked
        await self.page.start("swarm", options=asked)

    def draw_progress(self) -> None:
        """Shows the work under way, or the reason why there is none."""
        doing = self.bench.doing
        self.button.set_visibility(doing is None)
        self.progress.set_text(self.bench.progress if doing else "")
        self.failure.set_text(self.bench.failure)
        self.failure.set_visibility(bool(self.bench.failure))

    def draw(self) -> None:
        """Shows the result of the last run."""
        self.draw_progress()
        self.body.clear()
        swarm = self.bench.session.swarm
        played = swarm is not None and has_poses(swarm)
        self.waiting.set_visibility(not played)
        self.waiting.set_text(WAITING.format(STARTS) if swarm is None else KEPT)
        self.sheet.set_visibility(played)
        if swarm is None:
            return
        labels = list(swarm["swarms"])
        with self.body:
            markup("<div></div>" + "<div>{}</div>" * len(labels), *labels).classes("model head")
            kinds = sorted({k for s in swarm["swarms"].values() for k in s["classes"]})
            for kind in kinds:
                counts = [s["classes"].get(kind, 0) for s in swarm["swarms"].values()]
                self._row(kind, [f"{count} of {STARTS}" for count in counts])
            for name in SHOWN:
                values = [s["metrics"][name] for s in swarm["swarms"].values()]
                self._row(name, [scored(value) for value in values])
            ui.label(f"Classes and means of the last 10 s, over {STARTS} starts.").classes("soft")
            ui.label(
                "Phase diagram: the model as given, going and turning faster or slower by a "
                "factor. The points are both models, by how a robot goes that sees nobody."
            ).classes("soft")
            chart = ui.echart(_diagram(swarm)).props('data-testid="diagram"')
            chart.style("height: 290px; width: 100%")
            ui.label("The first start from a terminal:").classes("soft")
            markup("{}", commands_html(swarm["commands"])).props('data-testid="swarm-commands"')
        self.page.javascript("twinmill.showSwarm()")

    def _row(self, name: str, values: list[str]) -> None:
        markup("<div>{}</div>" * (1 + len(values)), name, *values).classes("model still")


def _diagram(swarm: dict) -> dict:
    """Cells in the colours of their classes, paler where runs differ, and the models' places."""
    cells = swarm["diagram"]
    values = sorted({cell["speed"] for cell in cells})
    half = (values[1] - values[0]) / 2
    ends = {"min": round(values[0] - half, 6), "max": round(values[-1] + half, 6)}
    given = next(iter(swarm["swarms"].values()))
    places = [
        {
            "value": [_over(s, given, "speed_mps"), _over(s, given, "turn_radps")],
            "name": label,
            "label": {"position": "top" if k else "bottom", "formatter": label},
        }
        for k, (label, s) in enumerate(swarm["swarms"].items())
    ]
    kinds = [kind for kind in COLORS if any(cell["class"] == kind for cell in cells)]
    return {
        "animation": False,
        "grid": {"left": 46, "right": 14, "top": 48, "bottom": 40},
        "legend": {"top": 0, "itemWidth": 12, "itemHeight": 12, "data": kinds},
        "tooltip": {},
        "xAxis": {"type": "value", "name": "speed", **AXIS, "nameGap": 24, **ends},
        "yAxis": {"type": "value", "name": "turn rate", **AXIS, "nameGap": 30, **ends},
        "series": [
            *(_cells(kind, [c for c in cells if c["class"] == kind]) for kind in kinds),
            {
                "type": "line",
                "data": places,
                "symbol": "circle",
                "symbolSize": 13,
                "itemStyle": {"color": "#ffffff", "borderColor": "#26343b", "borderWidth": 2.5},
                "lineStyle": {"color": "#26343b", "width": 2},
                "label": {"show": True, "fontWeight": "bold", "color": "#26343b",
                          "textBorderColor": "#ffffff", "textBorderWidth": 3},
                "z": 5,
            },
        ],
    }  # fmt: skip


def _over(swarm: dict, given: dict, name: str) -> float:
    """Factor of a quantity; 1 of one that the behaviour does not have."""
    return swarm[name] / given[name] if given[name] > LEAST else 1.0


def _cells(kind: str, cells: list[dict]) -> dict:
    """Squares of one class."""
    return {
        "name": kind,
        "type": "scatter",
        "symbol": "rect",
        "symbolSize": CELL_PX,
        "itemStyle": {"color": COLORS[kind]},
        "silent": True,
        "data": [
            {"value": [c["speed"], c["turn"]], "itemStyle": {"opacity": 0.25 + 0.6 * c["share"]}}
            for c in cells
        ],
    }
