"""FIGAROH as an opponent, where it is installed (``pip install figaroh``)."""

import importlib.util
import time
import warnings
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pinocchio as pin

MISSING = "skipped: not installed"


def regressor_rate(
    model: pin.Model, columns: np.ndarray, states: Sequence[tuple], samples: int, loops: int
) -> float | str:
    """States/s of FIGAROH's regressor with YᵀY, in so many loops on as many cores; why not, otherwise."""
    if importlib.util.find_spec("figaroh") is None:
        return MISSING
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of bindings that two packages register
        from figaroh.tools.regressor import RegressorBuilder
    builder = RegressorBuilder(SimpleNamespace(model=model, data=model.createData()))
    began = time.perf_counter()
    for first in range(0, len(states), samples):
        q, dq, ddq = (np.array(x) for x in zip(*states[first : first + samples]))
        y = builder.build_basic_regressor(q, dq, ddq, {"act_idxv": []})[:, columns]
        _ = y.T @ y / samples
    return loops * len(states) / (time.perf_counter() - began)
