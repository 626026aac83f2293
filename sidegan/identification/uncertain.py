"""What recordings left uncertain, as an aim of design: trajectories that tell it beside what is known."""

import torch
from torch import Tensor

from sidegan.design.prediction import Prediction, Told
from sidegan.errors import ShapeError
from sidegan.identification.model import TorqueModel

_LEAST = 1e-9  # of what is known of a parameter: keeps factors of singular information finite


class Uncertain(Prediction):
    """Minus the mean log eigenvalue of the information on a model's parameters, rotors and friction included.

    An aim of ``design.sequence``: trajectories are designed one after another, each given those before it.

    Args:
        model: that was identified.
        covariance: of its parameters' errors, (P, P).
        certainty: one over the deviation that a sample's torque error would have if samples were
            independent, (J,).
        rate: of the samples [Hz].

    Raises:
        ShapeError: when something does not fit the model.
    """

    def __init__(self, model: TorqueModel, covariance: Tensor, certainty: Tensor, rate: float) -> None:
        if covariance.shape != (model.count, model.count) or certainty.shape != (model.joints,):
            raise ShapeError(
                f"covariance {tuple(covariance.shape)} and certainty {tuple(certainty.shape)} are not of a "
                f"model with {model.count} parameters and {model.joints} joints"
            )
        self._model, self._certainty, self._rate = model, certainty, rate
        self._scale = covariance.diagonal().clamp_min(1e-300).sqrt()  # deviations: units of the parameters
        scaled = covariance / self._scale / self._scale[:, None]
        known = torch.linalg.pinv(scaled, hermitian=True)
        self.information = (known + known.T) / 2 + _LEAST * torch.eye(model.count, dtype=torch.float64)

    def told(self, q: Tensor, dq: Tensor, ddq: Tensor, seconds: float) -> Told:
        """What B trajectories of so many seconds tell, each alone, of their states (B, T, J)."""
        batch, count, joints = q.shape
        states = [x.reshape(-1, joints) for x in (q, dq, ddq)]
        y = self._regressor(*states) * self._certainty[:, None] * self._scale
        y = y.unflatten(0, (batch, count)).flatten(1, 2)
        nothing = q.new_zeros(batch, 0, 0)
        return Told(self._rate * seconds / count * (y.mT @ y), nothing, nothing)

    def value(self, new: Told) -> Tensor:
        """The aim after each of B trajectories beside what is known, (B,)."""
        factor = torch.linalg.cholesky(self.information + new.information)
        return -2 * factor.diagonal(dim1=1, dim2=2).log().mean(1)

    def take(self, new: Told) -> None:
        """Count one trajectory as known."""
        self.information = self.information + new.information[0].detach()

    def left(self, before: "Uncertain") -> float:
        """Deviations of the parameters over those of an earlier state of knowledge, geometric mean."""
        change = torch.logdet(self.information) - torch.logdet(before.information)
        return float((-change / (2 * self._model.count)).exp())

    def _regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """The model's regressor (S, J, P), differentiable in the states."""
        model, joints = self._model, self._model.joints
        rigid = model.body.base_regressor(q, dq, ddq)
        if not len(model.extras):
            return rigid
        signals = torch.stack(model.terms.signals(dq, ddq, model.stribeck))
        term, joint = model.extras // joints, model.extras % joints
        own = torch.nn.functional.one_hot(joint, joints).T.to(q)  # (J, E)
        return torch.cat([rigid, own * signals[term, :, joint].T[:, None]], 2)
