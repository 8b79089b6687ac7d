# SPDX-License-Identifier: Apache-2.0
"""Equations of the catalogue, plain text there, as HTML: slanted letters, powers, fractions."""

import html
import re

from markupsafe import Markup

GREEK = {"tau": "τ", "omega": "ω", "theta": "θ", "phi": "φ", "pi": "π"}
LETTERS = {"vx": "v_x", "vy": "v_y", "gx": "g_x", "gy": "g_y"}
STEPS = {"dt", "du", "dv", "dh"}
SIGNS = {"&lt;=": "≤", "&gt;=": "≥", " * ": " · ", "&#x27;": "\N{PRIME}"}
SIGNS |= {f"{before}-": f"{before}\N{MINUS SIGN}" for before in (" ", "(")}
DERIVATIVE = re.compile(r"\b(d\w+'?)/(dt)\b")
OVER = " / "
INSIDE = r"(?:[^()]|\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))*"  # brackets three deep
BRACKETS = rf"\w*\({INSIDE}\)"
ABOVE = re.compile(rf"(?:{BRACKETS}|\|[^|]*\||[\w.']+)$")
BELOW = re.compile(rf"{BRACKETS}(?:\^\d)?|\|[^|]*\||[\d.]+ [ms]\b|[\w.']+")
FRACTION = {"\1": '<span class="frac"><span>', "\2": "</span><span>", "\3": "</span></span>"}
TOKEN = re.compile(
    r"[\d.]+ (?:m/s|m|s)\b|[a-z]{2,}&#x27;s\b|&[#\w]+;|[A-Za-z]+(?:_[A-Za-z]+)*|"
    r"\d+(?:\.\d+)?e-?\d+|\^\d"
)


def typeset(equation: str) -> Markup:
    """As HTML; units keep their stroke: `0.02 m/s`."""
    text = TOKEN.sub(lambda match: _token(match[0]), html.escape(_stacked(equation)))
    for sign, seen in {**SIGNS, **FRACTION}.items():
        text = text.replace(sign, seen)
    return Markup(text)


def _stacked(equation: str) -> str:
    """With marks about what is above and below each line of a fraction."""
    text = DERIVATIVE.sub("\1\\1\2\\2\3", equation)
    while OVER in text:
        before, after = text.split(OVER, 1)
        above, below = ABOVE.search(before), BELOW.match(after)
        text = (
            f"{before[: above.start()]}\1{_bare(above[0])}\2{_bare(below[0])}\3"
            f"{after[below.end() :]}"
        )
    return text


def _bare(term: str) -> str:
    """Without the brackets about all of it, which the line makes needless."""
    return term[1:-1] if term.startswith("(") and term.endswith(")") else term


def _token(token: str) -> str:
    if token.startswith("&"):
        return token
    if token.endswith("&#x27;s"):  # a word of the text
        return token.replace("&#x27;", "\N{RIGHT SINGLE QUOTATION MARK}")
    if token.startswith("^"):
        return f"<sup>{token[1:]}</sup>"
    if token[-1] in "ms" and token[0].isdigit():
        return token
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
