# SPDX-License-Identifier: Apache-2.0
"""Hooks of MkDocs: command blocks get the output of a run. Run by itself it renews the catalogue.

A fenced block marked `console` holds commands, each after `$ `. All of a page that shows a part of
`runs/<page>/` run one after the other in an empty folder; what they print goes below them, and the
pictures and pages that they make go there. A command that fails ends the build, and so does a page
that would fetch something from the internet.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FENCE = re.compile(r"^`{3,}", re.MULTILINE)
ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
PICTURES = {".svg", ".png", ".html"}
EFFECTS = ROOT / "docs/effects.md"
EQUATION = re.compile(r"^```equation\n(.*)\n```$", re.MULTILINE)
FOREIGN = re.compile(
    r"""<(?:script|img|iframe)\b[^>]*\bsrc=["']?https?:[^>]*>|"""
    r"""<link\b[^>]*\brel=["']?(?:stylesheet|preload|icon)[^>]*https?:[^>]*>"""
)


def commands_of(page: str) -> list[str]:
    """The command lines of a page in their order."""
    return [
        line[2:]
        for block in BLOCK.findall(page)
        for line in block.splitlines()
        if line.startswith("$ ")
    ]


def run(command: str, folder: Path) -> str:
    """Standard output of a command that must succeed.

    Raises:
        RuntimeError: it failed; its own words.
    """
    scripts = f"{Path(sys.executable).parent}{os.pathsep}{ROOT / 'build' / 'bin'}"
    environment = {**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}"}
    environment |= {"EXAMPLES": str(ROOT / "examples"), "COLUMNS": "80"}
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"$ {command}\n{done.stdout}{done.stderr}")
    return ANSI.sub("", done.stdout)


def with_outputs(page: str, folder: Path) -> str:
    """The page with the output of each command below it."""

    def replaced(match: re.Match) -> str:
        lines = []
        for line in match[1].splitlines():
            lines.append(line)
            if line.startswith("$ "):
                lines += [text.rstrip() for text in run(line[2:], folder).splitlines()]
        longest = max((len(line) for line in FENCE.findall("\n".join(lines))), default=2)
        fence = "`" * (longest + 1)  # a shorter one does not end the block
        return "\n".join([f"{fence}console", *lines, fence])

    return BLOCK.sub(replaced, page)


def page_of_effects() -> str:
    """Its beginning as it stands, and a card of each effect with its equation and parameters."""
    from twinmill.model.parameters import catalogue

    beginning = EFFECTS.read_text(encoding="utf-8").partition("\n## ")[0].rstrip()
    return "\n".join([beginning, "", *(_card(card) for _, card in sorted(catalogue().items()))])


def _card(card: dict) -> str:
    from twinmill.report.show import robots

    rows = [
        f"| `{p['name']}` | {'' if p['unit'] == '1' else p['unit']} | {p['default']:g} | "
        f"{p['min']:g} to {p['max']:g} | {p['neutral']:g} | {p['doc']} |"
        for p in card["parameters"]
    ]
    table = ["| parameter | unit | default | bounds | neutral | meaning |", "|---" * 6 + "|", *rows]
    return "\n".join(
        [
            f"## {card['name']}\n",
            f"{card['summary']}\n",
            f"```equation\n{card['equation']}\n```\n",
            *([*table, ""] if rows else []),
            f"- Stage: `{card['stage']}`",
            f"- For robots {robots(card)}",
            f"- Leaves out: {card['leaves_out']}",
            f"- What to measure: {card['measure']}",
            f"- Source: {card['reference']}\n",
        ]
    )


def on_files(files, config):
    """Called by MkDocs once: equations look as they do in the workbench."""
    from mkdocs.structure.files import File

    from twinmill.workbench import typeset

    sheet = Path(typeset.__file__).parent / "static/equation.css"
    files.append(File.generated(config, sheet.name, abs_src_path=str(sheet)))
    return files


def on_page_markdown(markdown: str, page, config, files) -> str:
    """Called by MkDocs for each page."""
    from mkdocs.structure.files import File

    from twinmill.workbench.typeset import typeset

    markdown = EQUATION.sub(lambda own: f'<div class="eq">{typeset(own[1])}</div>', markdown)
    if "runs/" in markdown:
        folder = Path(tempfile.mkdtemp(prefix="twinmill.docs."))
        markdown = with_outputs(markdown, folder)
        for path in sorted(folder.rglob("*")):
            if path.suffix in PICTURES:
                name = f"runs/{Path(page.file.src_path).stem}/{path.relative_to(folder)}"
                files.append(File.generated(config, name, abs_src_path=str(path)))
    return markdown


def on_post_page(output: str, page, config) -> str:
    """Called by MkDocs for each page as it will be written."""
    if foreign := FOREIGN.search(output):
        raise ValueError(
            f"{page.file.src_path}: {foreign[0]}: needs the internet; ship it instead."
        )
    return output


if __name__ == "__main__":
    EFFECTS.write_text(page_of_effects(), encoding="utf-8")
