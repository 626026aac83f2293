"""Opponent of sidegan: Pinocchio from Python, state by state, as one would write it."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from sidegan.validity import Constraints
from tests.oracle import capsule_geometry, chain_model

Array = np.ndarray
State = Sequence[Array]  # position, velocity and acceleration, (J,) each

_CERTAIN = 1e6  # variance of parameters before any sample


class Pinocchio:
    """Regressors, estimates and checks of an arm by Pinocchio, NumPy and coal."""

    def __init__(self, constraints: Constraints) -> None:
        self.model = chain_model(constraints.arm)
        self.data = self.model.createData()
        self.columns = constraints.body.base.columns.numpy()
        self.geometry = capsule_geometry(constraints.arm)
        for first, second in constraints.pairs.tolist():
            self.geometry.addCollisionPair(pin.CollisionPair(first, second))
        self.shapes = self.geometry.createData()

    def regressor(self, state: State) -> Array:
        """Base regressor (J, p) of a state."""
        return pin.computeJointTorqueRegressor(self.model, self.data, *state)[:, self.columns]

    def gram(self, states: Sequence[State]) -> Array:
        """YᵀY (p, p) of a trajectory."""
        y = np.concatenate([self.regressor(state) for state in states])
        return y.T @ y / len(states)

    def check(self, states: Sequence[State]) -> None:
        """Torques and distances at samples, with nothing proven between them."""
        for q, dq, ddq in states:
            pin.rnea(self.model, self.data, q, dq, ddq)
            pin.computeDistances(self.model, self.data, self.geometry, self.shapes, q)

    def estimate(self, states: Sequence[State], torques: Array) -> Array:
        """Base parameters (p,) by recursive least squares in its covariance form, one gain per sample."""
        count = len(self.columns)
        covariance, estimate = _CERTAIN * np.eye(count), np.zeros(count)
        for state, torque in zip(states, torques):
            y = self.regressor(state)
            carried = covariance @ y.T
            gain = np.linalg.solve(np.eye(len(y)) + y @ carried, carried.T).T
            estimate = estimate + gain @ (torque - y @ estimate)
            covariance = covariance - gain @ carried.T
            covariance = (covariance + covariance.T) / 2  # else rounding makes it diverge
        return estimate
