"""Recursive least squares on line: an estimate that follows an arm sample by sample."""

import math
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.estimate import Estimate
from sidegan.identification.fit import LEAST_INFORMATION, positive
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import solve
from sidegan.robot import StateRegressor

Array: TypeAlias = NDArray[np.float64]


class Live:
    """Recursive least squares with forgetting, one sample of all joints at a time.

    The recursion runs on the information Σ λ^age Yᵀ W Y, which neither loses symmetry nor precision over
    hours, and equals batch least squares; the parameters are solved for when they are asked for.

    Args:
        model: what torque is explained with.
        forgetting: λ in (0, 1]; about 1 / (1 − λ) samples are remembered.
        prior: variance of each parameter before any sample, without a start.
        start: an earlier estimate to go on from with its weights, whose samples count like those of this arm.

    Raises:
        ConfigError: when a setting is impossible or the start is of another model.
    """

    def __init__(
        self, model: TorqueModel, forgetting: float = 1.0, prior: float = 1e6, start: Estimate | None = None
    ) -> None:
        positive("forgetting", forgetting, 1.0)
        positive("prior", prior)
        if start is not None and start.names != tuple(model.names):
            raise ConfigError("the estimate to start from has other parameters than the model")
        self._model, self._rigid = model, StateRegressor(model.arm)
        self._columns = model.body.base.columns.numpy()
        self._term, self._joint = np.divmod(model.extras.numpy(), model.joints)
        self._place = np.arange(model.rigid, model.count)
        self._rows = np.zeros((model.joints, model.count))
        self._forgetting, self._shape = forgetting, (model.joints,)
        self._weights = np.ones(self._shape) if start is None else start.weights.numpy()
        self._information = np.eye(model.count) / prior
        self._moment = np.zeros(model.count)
        if start is not None:
            self._information += start.information.numpy()
            self._moment += self._information @ start.parameters.numpy()
        self._step = np.empty_like(self._information)
        self._parameters: Array | None = None
        self.samples = 0

    def update(self, q: Array, dq: Array, ddq: Array, torque: Array) -> None:
        """Take in one sample: position, velocity, acceleration and torque [N·m or N], (J,) each.

        Raises:
            ShapeError: when a shape does not fit or a value is not finite; the sample is then left out.
        """
        for x in (q, dq, ddq, torque):
            if x.shape != self._shape:
                raise ShapeError(f"a sample has shape {x.shape}, expected {self._shape}")
        if not math.isfinite(q @ q + dq @ dq + ddq @ ddq + torque @ torque):
            raise ShapeError("a sample holds a value that is not finite or too large to square")
        rows = self._regressor(q, dq, ddq) * self._weights[:, None]
        if self._forgetting < 1:
            self._information *= self._forgetting
            self._moment *= self._forgetting
        np.dot(rows.T, rows, out=self._step)
        self._information += self._step
        self._moment += (torque * self._weights) @ rows
        self._parameters = None
        self.samples += 1

    def residual(self, q: Array, dq: Array, ddq: Array, torque: Array) -> Array:
        """Torque that the present parameters do not explain [N·m or N], (J,), of one sample."""
        return torque - self._regressor(q, dq, ddq) @ self.parameters

    @property
    def parameters(self) -> Array:
        """Present parameters θ, (P,)."""
        if self._parameters is None:
            _, parameters, failed = dposv(self._information, self._moment)
            self._parameters = self._solved()[0] if failed else parameters
        return self._parameters

    @property
    def covariance(self) -> Array:
        """Inverse of the information, (P, P): the errors' covariance when weights are 1 / deviation."""
        return self._solved()[1]

    def _regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """What ``TorqueModel.regressor`` gives of one state, (J, P); the next call overwrites it."""
        q, dq, ddq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))
        self._rows[:, : self._model.rigid] = self._rigid(q, dq, ddq)[:, self._columns]
        if len(self._place):
            speed, kick = torch.from_numpy(dq), torch.from_numpy(ddq)
            signals = torch.stack(self._model.terms.signals(speed, kick, self._model.stribeck)).numpy()
            self._rows[self._joint, self._place] = signals[self._term, self._joint]
        return self._rows

    def _solved(self) -> tuple[Array, Array]:
        information, moment = torch.from_numpy(self._information), torch.from_numpy(self._moment)
        parameters, inverse = solve(information, moment, LEAST_INFORMATION)
        return parameters.numpy(), inverse.numpy()
