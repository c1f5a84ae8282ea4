"""Packages that tests compare with, if installed (the extra ``test-all``)."""

import pytest


class _Optional:
    """A package imported at its first use, which skips the test without the package."""

    def __init__(self, name):
        self._name = name

    def __getattr__(self, attribute):
        return getattr(pytest.importorskip(self._name, reason=f"{self._name} is not installed"), attribute)


igl = _Optional("igl")
