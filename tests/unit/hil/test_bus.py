"""What is said where there is no bus."""

from __future__ import annotations

import pytest

from gustform.language.errors import GustformError
from gustform_hil.bus import Bus, check_interface


@pytest.mark.parametrize("name", ["nocan7", "../etc", "a" * 16, "", "vcan0; rm"])
def test_an_interface_that_is_none(name: str) -> None:
    with pytest.raises(GustformError, match="GF8071"):
        check_interface(name, fd=True)
    with pytest.raises(GustformError, match="GF8071"):
        Bus(name)


def test_an_interface_of_another_kind() -> None:
    with pytest.raises(GustformError, match=r"GF8071.*another kind"):
        check_interface("lo", fd=False)
