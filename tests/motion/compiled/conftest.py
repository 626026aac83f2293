import pytest

from sidegan.motion.compiled import VARIABLE


@pytest.fixture(params=["torch", "numba"])
def engine(request, monkeypatch):
    """Both ways of doing the same work."""
    if request.param == "numba":
        pytest.importorskip("numba")
    monkeypatch.setenv(VARIABLE, request.param)
    return request.param
