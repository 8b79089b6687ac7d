# SPDX-License-Identifier: Apache-2.0
"""Numbers are read as a person means them, and not as Python does."""

import pytest

from twinmill.numbers_typed import typed_float, typed_int

# All of these Python reads: as 12, 1 (of Arabic script), 1 and 5.
SLIPS = ["1_2", "\u0661", "1\u00a0", " 5"]


@pytest.mark.parametrize("text", [*SLIPS, "", "1.0", "0x1", "1\udca0"])
def test_what_is_no_number_to_a_person_is_none(text):
    with pytest.raises(ValueError, match="digits 0-9"):
        typed_int(text)


@pytest.mark.parametrize("text", [*SLIPS, "", "nan", "inf", "1e400", "3,5", "1\udca0"])
def test_what_is_no_finite_number_to_a_person_is_none(text):
    with pytest.raises(ValueError, match="digits 0-9"):
        typed_float(text)


@pytest.mark.parametrize("text", ["12", "-3", "+07"])
def test_whole_numbers_are_read_as_python_does(text):
    assert typed_int(text) == int(text)


@pytest.mark.parametrize("text", ["12", "-0.5", ".5", "5.", "1e-3", "+2E3"])
def test_numbers_are_read_as_python_does(text):
    assert typed_float(text) == float(text)


@pytest.mark.parametrize("text", ["1_0", "\u0661", " 5"])
@pytest.mark.parametrize(
    "words",
    [
        ["swarm", "start", "--in-s"],
        ["swarm", "start", "--robots"],
        ["swarm", "select", "milling", "--robots"],
    ],
)
def test_a_slip_in_an_option_is_refused(twinmill, words, text):
    code, _, err = twinmill(*words, text)
    assert code in (1, 2) and text.strip() in err and len(err.splitlines()) == 1
