"""Cases of a test of which most are slow: the same on more of the data."""

import pytest


def every(step, cases):
    """Return these cases as parameters, all but each so-many-th of them marked slow."""
    return [pytest.param(case, marks=() if k % step == 0 else pytest.mark.slow) for k, case in enumerate(cases)]
