"""A plant that is identified after each trajectory: what is known of it then, and how well."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import ConfigError
from sidegan.identification import TorqueModel
from sidegan.identification.accuracy import inflation_of
from sidegan.identification.prior import belief
from sidegan.identification.uncertain import rigid_information
from sidegan.plant.varied import VariedPlant
from sidegan.worth.curves import FIRST, Judge, disturbed
from sidegan.worth.intervals import held
from sidegan.worth.orders import SetOf
from sidegan.worth.settings import Regime

_ROUNDS = 4  # of weights from residuals
_LEAST = 1e-3  # of a joint's torque: smaller residuals are not believed
_SPENT = 0.5  # of the samples may count as spent on parameters


class Known(NamedTuple):
    """What is known of a plant."""

    parameters: Tensor  # (P,)
    information: Tensor  # on them, what was believed at first included, (P, P)
    intensity: Tensor  # of the torques' noise: variance of a mean over one second [N²·m²·s or N²·s], (J,)

    @property
    def covariance(self) -> Tensor:
        """Covariance of the parameters' errors, (P, P)."""
        unit = self.information.diagonal().sqrt()
        factor = torch.linalg.cholesky(self.information / unit[:, None] / unit)
        return torch.cholesky_inverse(factor) / unit[:, None] / unit

    def rigid(self, model: TorqueModel) -> Tensor:
        """Information on rigid bodies where all else is unknown, in their orthonormal basis, (q, q)."""
        return rigid_information(model, self.covariance)

    def deviation(self, tasks: Tensor) -> float:
        """Standard deviation of torque on tasks, as a share, of the tasks' mean YᵀY over squares (P, P)."""
        return float((tasks * self.covariance).sum().sqrt())

    def covered(self, true: Tensor) -> float:
        """Share of the parameters whose 95 % intervals hold the true ones, (P,)."""
        return float(held(self.parameters, self.covariance.diagonal().sqrt(), true))


class Session:
    """One plant in one regime, identified by weighted least squares from all that it has executed so far.

    Weights and intervals allow for noise that keeps its sign: samples count as often as they tell something.

    Raises:
        ConfigError: in a regime that drifts, of which a single recording knows nothing.
    """

    def __init__(self, judge: Judge, plant: VariedPlant, regime: Regime, seed: int) -> None:
        if regime.drift:
            raise ConfigError("a closed loop is identified between recordings: choose a regime without drift")
        self.judge, self.plant, self.seed = judge, plant, seed
        settings, model = judge.settings, judge.model
        self.scale = torch.from_numpy(plant.scale)
        self.prior = belief(model, self.scale, settings.believed)
        quiet = 2 * settings.sensors.correlation * (FIRST * self.scale) ** 2
        self.known = Known(model.nominal, self.prior, quiet)
        self.seconds = 0.0
        self._recorded: list[tuple[Tensor, Tensor]] = []  # regressor (S, J, P) and torque (S, J)
        self._grams: list[Tensor] = []  # (J, P, P)

    def execute(self, one: SetOf) -> Known:
        """What is known after further trajectories, a recording each."""
        y, torque, friction, _ = self.judge.followed(self.plant, [one])[0]
        for k in range(len(y)):
            random = np.random.default_rng([self.seed, len(self._recorded)])
            noise = disturbed(
                friction[k : k + 1], self.plant.scale, self.judge.settings.sensors, False, 1, random
            )
            self._recorded.append((y[k], torque[k] + noise[0]))
            rows = y[k].transpose(0, 1)
            self._grams.append(rows.mT @ rows)
        self.seconds += len(y) * one.family.period
        self.known = self._identified()
        return self.known

    def _identified(self) -> Known:
        gram = torch.stack(self._grams).sum(0)
        moment = torch.stack([torch.einsum("sjp,sj->jp", y, torque) for y, torque in self._recorded]).sum(0)
        samples = sum(len(torque) for _, torque in self._recorded)
        known = self.known
        for _ in range(_ROUNDS):
            weights = 1 / (known.intensity * self.judge.settings.sensors.rate)  # of a sample
            information = self.prior + torch.einsum("j,jpq->pq", weights, gram)
            right = self.prior @ self.judge.model.nominal + weights @ moment
            known = Known(known.parameters, information, known.intensity)
            covariance = known.covariance
            parameters = covariance @ right
            spent = torch.einsum("pq,jpq->j", covariance, gram)
            known = Known(parameters, information, self._intensity(parameters, spent, samples))
        return known

    def _intensity(self, parameters: Tensor, spent: Tensor, samples: int) -> Tensor:
        """Of the noise that residuals show, (J,), with the share added that parameters have taken out."""
        residuals = [torque - y @ parameters for y, torque in self._recorded]
        variance = torch.cat(residuals).square().mean(0)
        taken = (spent / variance / samples).clamp_max(_SPENT)
        variance = torch.maximum(variance / (1 - taken), (_LEAST * self.scale) ** 2)
        return variance * inflation_of(residuals) / self.judge.settings.sensors.rate
