# SPDX-License-Identifier: Apache-2.0
"""Numbers and their tones as the panels say them."""

import html
import math
import re

from twinmill.fitting.compare import GOOD, MISSING


def scored(score: float | None) -> str:
    """A score, or a dash."""
    return "-" if score is None or math.isnan(score) else f"{score:#.3g}".rstrip(".")


def tone(score: float | None) -> str:
    """CSS class of a score."""
    if score is None or not math.isfinite(score):
        return "soft"
    return "good" if score <= GOOD else "warn" if score <= MISSING else "bad"


def estimate(entry: dict) -> str:
    """A parameter as --json gives it: `deceleration 0.7 ± 0.02 m/s²`."""
    name = entry["name"].split(".", 1)[-1]
    unit = "" if entry["unit"] == "1" else f" {entry['unit'].replace('^2', '²')}"
    spread = f" ± {entry['std']:.1g}" if entry["std"] is not None else ""
    return f"{name} {entry['value']:.3g}{spread}{unit}"


GREEK = {"tau": "τ", "omega": "ω", "theta": "θ", "phi": "φ", "pi": "π"}
LETTERS = {"vx": "v_x", "vy": "v_y", "gx": "g_x", "gy": "g_y"}
STEPS = {"dt", "du", "dv", "dh"}
SIGNS = {"&lt;=": "≤", "&gt;=": "≥", " - ": " \N{MINUS SIGN} ", " * ": " · ", "&#x27;": "\N{PRIME}"}
TOKEN = re.compile(r"&[#\w]+;|[A-Za-z]+(?:_[A-Za-z]+)*|\d+(?:\.\d+)?e-?\d+|\^\d")


def typeset(equation: str) -> str:
    """An equation of the catalogue as HTML: letters slanted, names upright, powers, indices."""
    text = TOKEN.sub(lambda match: _token(match[0]), html.escape(equation))
    for sign, seen in SIGNS.items():
        text = text.replace(sign, seen)
    return text


def _token(token: str) -> str:
    if token.startswith("&"):
        return token
    if token.startswith("^"):
        return f"<sup>{token[1:]}</sup>"
    if token[0].isdigit():
        digits, power = token.split("e")
        times = "" if digits == "1" else f"{digits} · "
        return f"{times}10<sup>{int(power)}</sup>".replace("-", "\N{MINUS SIGN}")
    name, _, index = LETTERS.get(token, token).partition("_")
    if len(name) > 1 and len(index) > 1:  # a name of several words
        return token.replace("_", " ")
    name = GREEK.get(name, name)
    seen = f"<i>{name}</i>" if len(name) == 1 or name in STEPS else name
    return f"{seen}<sub>{index}</sub>" if index else seen
