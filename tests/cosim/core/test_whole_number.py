"""A count is a whole number; any other value is refused with the error of its caller."""

from __future__ import annotations

import pytest

from cosim import DeclarationError, OptionError
from cosim.core.whole_number import whole_number


@pytest.mark.parametrize("value", [0, -1, 1.5, "3", None, float("inf"), float("nan"), 2**54, True + 0.5])
def test_any_other_value_is_refused(value):
    with pytest.raises(DeclarationError, match=r"size=.* must be a whole number, 1 or more"):
        whole_number("size", value)


@pytest.mark.parametrize("value", [1, 3.0, True])
def test_whole_numbers(value):
    assert whole_number("size", value) == int(value)
    assert whole_number("seed", 0, least=0) == 0


def test_the_caller_chooses_the_error():
    with pytest.raises(OptionError, match="decimation=0 must be a whole number, 1 or more"):
        whole_number("decimation", 0, error=OptionError)
