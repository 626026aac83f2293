"""One walk through the samples: their sums, and a share of them to judge residuals by."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums, finite, no_sums, sums_of

_KEPT = 48  # pieces that are remembered: enough for residual statistics, 45 MB of a 7-joint arm


class Reach(NamedTuple):
    """Range and speed of each joint's motion, (J,) each."""

    range: Tensor  # between the furthest positions [rad or m]
    fastest: Tensor  # velocity [rad/s or m/s]


@dataclass(frozen=True)
class Gathered:
    """Sums over samples, and a share of these, from which every method fits its parameters."""

    model: TorqueModel  # whose parameters are looked for
    sums: Sums  # over all samples
    kept: list[Measurements]  # pieces spread evenly over the samples, each without gaps
    samples: int  # number of samples of all joints
    reach: Reach  # of the joints in them


def gather(model: TorqueModel, measurements: Samples, forgetting: float = 1.0) -> Gathered:
    """Sums over measurements, which are read once and in pieces, and a share of the samples.

    They are one recording, several, or a stream of them in the order of time; a sample of age k counts
    forgetting^k as much.

    Raises:
        ShapeError: when there are no samples, or they do not fit the model.
    """
    sums, samples, stride = no_sums(model.joints, model.count), 0, 1
    kept: list[Measurements] = []
    ends = torch.full((3, model.joints), -torch.inf, dtype=torch.float64)  # −lowest, highest, fastest so far
    for number, part in enumerate(pieces(measurements)):
        sums = sums.times(forgetting ** len(part)).plus(_sums(model, part, forgetting))
        q, speed = part.position, part.velocity.abs()
        ends = torch.maximum(ends, torch.stack([(-q).amax(0), q.amax(0), speed.amax(0)]))
        samples += len(part)
        if number % stride == 0:
            kept.append(part)
        if len(kept) > _KEPT:
            kept, stride = kept[::2], 2 * stride
    if not samples:
        raise ShapeError("there are no samples to identify from")
    return Gathered(model, sums, kept, samples, Reach(ends[0] + ends[1], ends[2]))


def weighted_sums(model: TorqueModel, part: Measurements, weights: Tensor) -> Sums:
    """Sums over one piece whose equations count with weights (S, J)."""
    root = weights.sqrt()
    return sums_of(_regressor(model, part) * root[..., None], part.torque * root)


def residual_of(model: TorqueModel, part: Measurements, parameters: Tensor) -> Tensor:
    """Residual τ − Y θ [N·m or N], (S, J), of a piece."""
    return part.torque - _regressor(model, part) @ parameters


def _sums(model: TorqueModel, part: Measurements, forgetting: float) -> Sums:
    rigid = not model.kinds and part.joints == model.joints
    if forgetting < 1 or not rigid:
        return sums_of(_regressor(model, part), part.torque.double(), forgetting)
    # The same for rigid bodies alone, which keeps no regressor.
    products = model.body.sums(*part.states, part.torque)
    information, moment, energy = products[:, :-1, :-1], products[:, :-1, -1], products[:, -1, -1]
    weight = torch.tensor(float(len(part)), dtype=torch.float64)
    return finite(Sums(information, moment, energy, part.torque.detach().sum(0), weight))


def _regressor(model: TorqueModel, part: Measurements) -> Tensor:
    if part.joints != model.joints:
        raise ShapeError(f"measurements have {part.joints} joints, the model has {model.joints}")
    return model.regressor(*(x.double() for x in part.inputs))
