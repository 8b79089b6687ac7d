# SPDX-License-Identifier: Apache-2.0
"""The panel of models tried: a tree with scores, the command that makes each, and saving."""

from pathlib import Path

from nicegui import ui

from twinmill.workbench.panel import PageActions, check_free, commands_html, markup, scored, tone
from twinmill.workbench.tree import Tried

INDENT_PX = 14


class ModelsPanel:
    """Draws the tree."""

    def __init__(self, page: PageActions) -> None:
        self.page, self.bench = page, page.bench
        self.body = ui.element("div").classes("stack").props('data-testid="models"')
        with ui.element("div").classes("buttons"):
            self.path = ui.input("Save as", placeholder="better.toml")
            self.path.props('dense outlined data-testid="save-as"').style("flex: 1")
            self.path.on("keydown.enter", self._save)
            self.path.on_value_change(self._draw_commands)
            self.button = ui.button("Save", on_click=self._save)
            self.button.props('dense unelevated no-caps padding="4px 16px" data-testid="save"')
        self.commands = ui.element("div").classes("stack")

    def draw(self) -> None:
        """The tree as it is now."""
        tree = self.bench.session.tree
        self.body.clear()
        with self.body:
            markup("<div>model</div><div>fitted</div><div>held out</div>").classes("model head")
            for tried, depth in _ordered(tree.tried, tree.current.number):
                self._row(tried, depth)
        self.button.set_enabled(tree.current.number != 0)
        self._draw_commands()

    def _row(self, tried: Tried, depth: int) -> None:
        tree = self.bench.session.tree
        score = tree.scores.get(tried.number)
        fitted, heldout = (score.fitted, score.heldout) if score else (None, None)
        about = "" if score is None or score.exact else "≈ "
        row = markup(
            '<div style="padding-left:{}px">{}</div>'
            '<div class="{}">{}</div><div class="{}">{}</div>',
            *(INDENT_PX * depth, tried.label),
            *(tone(fitted), f"{about}{scored(fitted)}"),
            *(tone(heldout), scored(heldout)),
        ).props(f'data-testid="model-{tried.number}"')
        row.classes("model now" if tried.number == tree.current.number else "model")
        row.props("role=button tabindex=0")
        for event in ("click", "keydown.enter"):
            row.on(event, lambda n=tried.number: self.page.go(n))

    def _draw_commands(self) -> None:
        tree = self.bench.session.tree
        self.commands.clear()
        if tree.current.number == 0:
            return
        out = self.path.value or tree.file_name(tree.current.number)
        commands, _ = tree.written(tree.current.number, out)
        with self.commands:
            ui.label("The same from a terminal:").classes("soft")
            markup("{}", commands_html(commands)).props('data-testid="commands"')
            if self.bench.session.is_outdated:
                ui.label(
                    f"{tree.name} was changed since it was opened: now these commands make "
                    "another model."
                ).classes("note wrong").props('data-testid="outdated"')

    def _save(self) -> None:
        name = (self.path.value or "").strip()
        if not name:
            ui.notify("Name a file to save the model as.", type="warning")
            return
        try:
            check_free(Path(name))
            self.bench.session.save(Path(name))
        except ValueError as error:
            ui.notify(str(error), type="negative")
            return
        ui.notify(f"Written: {name}", type="positive")


def _ordered(tried: list[Tried], current: int) -> list[tuple[Tried, int]]:
    """Parents before their children, with the depth of each; of one hand's turns the last alone."""
    children: dict[int | None, list[Tried]] = {}
    for t in tried:
        children.setdefault(t.parent, []).append(t)
    rows: list[tuple[Tried, int]] = []

    def walk(node: Tried, depth: int) -> None:
        rows.append((node, depth))
        below = children.get(node.number, [])
        by_hand = [t for t in below if t.values and not children.get(t.number)]
        kept = {t.number for t in by_hand if t.number == current} or {
            t.number for t in by_hand[-1:]
        }
        for child in below:
            if child not in by_hand or child.number in kept:
                walk(child, depth + 1)

    walk(tried[0], 0)
    return rows
