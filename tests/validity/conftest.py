"""Both engines of the check."""

import pytest

from sidegan.motion.compiled import VARIABLE, compiled


@pytest.fixture(params=["compiled", "plain"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Every law holds for the compiled kernel and for torch alone."""
    if request.param == "plain":
        monkeypatch.setenv(VARIABLE, "torch")
    elif not compiled():
        pytest.skip("numba is not installed")
    return request.param
