"""End-to-end protection by the public package autosar-e2e: profiles 1, 2 and 5, header first in the frame.

The bridge has its own C of the same (bridge/src/e2e.c); the two are compared in the tests.
"""

from __future__ import annotations

from typing import Any

from gustform.language.errors import GustformError
from gustform_hil.message_set import E2E


def _package() -> Any:
    try:
        import e2e
    except ImportError:
        raise GustformError(
            "GF8000", "the package autosar-e2e must be installed to protect frames", hint="pip install 'gustform[hil]'"
        ) from None
    return e2e


class Protector:
    """Protects and checks the frames of one message."""

    def __init__(self, e2e: E2E) -> None:
        self.e2e = e2e
        self._package: Any = _package() if e2e.profile else None

    def protect(self, data: bytearray, counter: int) -> None:
        """Write counter (modulo what the profile counts) and CRC into the frame."""
        e2e, package = self.e2e, self._package
        count = counter % e2e.modulo
        if e2e.profile == 5:
            data[2] = count
            package.p05.e2e_p05_protect(data, e2e.data_id, increment_counter=False)
        elif e2e.profile:
            data[1] = (data[1] & 0xF0) | count
            if e2e.profile == 2:
                package.p02.e2e_p02_protect(data, e2e.id_list, increment_counter=False)
            else:
                package.p01.e2e_p01_protect(data, e2e.data_id, increment_counter=False)

    def good(self, data: bytes) -> bool:
        """Whether CRC and counter are what the profile allows."""
        e2e, package = self.e2e, self._package
        if e2e.profile == 5:
            return bool(package.p05.e2e_p05_check(data, e2e.data_id))
        if e2e.profile == 2:
            return bool(package.p02.e2e_p02_check(data, e2e.id_list))
        if e2e.profile == 1:
            # This check of the package wants a buffer that it could write to.
            return data[1] & 0x0F < e2e.modulo and bool(package.p01.e2e_p01_check(bytearray(data), e2e.data_id))
        return True

    def counter(self, data: bytes) -> int:
        """Of a frame; 0 without protection."""
        if self.e2e.profile == 0:
            return 0
        return data[2] if self.e2e.profile == 5 else data[1] & 0x0F
