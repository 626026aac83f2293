"""One walk through the samples: their sums, and a share of them to judge residuals by."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.measurements import Measurements, chunks
from sidegan.identification.sums import Sums, no_sums, sums_of

SAMPLES_AT_ONCE = 4096  # their regressor of a 7-joint arm takes 16 MB
_KEPT = 48  # chunks that are remembered: enough for residual statistics, 45 MB of a 7-joint arm

Samples = Measurements | Iterable[Measurements]


class Linear(Protocol):
    """A model of torque that is linear in its parameters."""

    names: list[str]

    @property
    def joints(self) -> int:
        """Number of joints J."""
        ...

    @property
    def count(self) -> int:
        """Number of parameters P."""
        ...

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor, sign: Tensor | None = None) -> Tensor:
        """Regressor (S, J, P) of states (S, J), with the sign for friction where torque was filtered."""
        ...


@dataclass(frozen=True)
class Gathered:
    """What a walk through the samples leaves.

    Attributes:
        sums: over all samples.
        kept: chunks spread evenly over the samples, each without gaps.
        samples: number of samples of all joints.
        reach: what the arm did in them.
    """

    sums: Sums
    kept: list[Measurements]
    samples: int
    reach: "Reach"


class Reach(NamedTuple):
    """How far and how fast each joint moved, (J,) each.

    Attributes:
        lowest: position [rad or m].
        highest: position [rad or m].
        fastest: velocity [rad/s or m/s].
    """

    lowest: Tensor
    highest: Tensor
    fastest: Tensor

    def joined(self, other: "Reach") -> "Reach":
        """What the joints did in both."""
        return Reach(
            torch.minimum(self.lowest, other.lowest),
            torch.maximum(self.highest, other.highest),
            torch.maximum(self.fastest, other.fastest),
        )

    @property
    def range(self) -> Tensor:
        """Distance between the furthest positions, (J,)."""
        return self.highest - self.lowest


def reach_of(part: Measurements) -> Reach:
    """How far and how fast the joints moved in some samples."""
    return Reach(part.position.amin(0), part.position.amax(0), part.velocity.abs().amax(0))


def gather(
    model: Linear,
    measurements: Samples,
    samples_at_once: int = SAMPLES_AT_ONCE,
    forgetting: float = 1.0,
) -> Gathered:
    """Sums over measurements, which are read once and in pieces, and a share of the samples.

    Args:
        model: linear in its parameters.
        measurements: one recording, several, or a stream of them in the order of time.
        samples_at_once: largest number of samples whose regressor is held.
        forgetting: a sample of age k counts forgetting^k as much.

    Raises:
        ConfigError: when ``samples_at_once`` is not positive.
        ShapeError: when there are no samples, or they do not fit the model.
    """
    sums, samples, stride = no_sums(model.joints, model.count), 0, 1
    kept: list[Measurements] = []
    reach: Reach | None = None
    for number, part in enumerate(pieces(measurements, samples_at_once)):
        chunk = sums_of(_regressor(model, part), part.torque.double(), forgetting)
        sums = sums.times(forgetting ** len(part)).plus(chunk)
        reach = reach_of(part) if reach is None else reach.joined(reach_of(part))
        samples += len(part)
        if number % stride == 0:
            kept.append(part.copy())
        if len(kept) > _KEPT:
            kept, stride = kept[::2], 2 * stride
    if reach is None:
        raise ShapeError("there are no samples to identify from")
    return Gathered(sums, kept, samples, reach)


def pieces(measurements: Samples, samples: int = SAMPLES_AT_ONCE) -> Iterator[Measurements]:
    """The same samples in pieces of at most ``samples``; no piece reaches over the end of a recording.

    Raises:
        ShapeError: when something among the measurements is none.
    """
    for part in [measurements] if isinstance(measurements, Measurements) else measurements:
        if not isinstance(part, Measurements):
            raise ShapeError(f"measurements hold a {type(part).__name__}, expected Measurements")
        yield from chunks(part, samples)


def again(measurements: Samples, method: str) -> Samples:
    """The measurements, which have to be of a kind that can be read more than once.

    Raises:
        ConfigError: when they are a stream.
    """
    if isinstance(measurements, Iterator):
        raise ConfigError(
            f"{method} reads the samples several times, and a stream can be read once: give a list of "
            "recordings, or choose ols, weighted, rls, tls, ridge, essential or consistent"
        )
    return measurements


def weighted_sums(model: Linear, part: Measurements, weights: Tensor) -> Sums:
    """Sums over one piece whose equations count with weights (S, J)."""
    root = weights.sqrt()
    y = _regressor(model, part) * root[..., None]
    return sums_of(y, part.torque * root)


def residual_of(model: Linear, part: Measurements, parameters: Tensor) -> Tensor:
    """Residual τ − Y θ [N·m or N], (S, J), of a piece."""
    return part.torque - _regressor(model, part) @ parameters


def _regressor(model: Linear, part: Measurements) -> Tensor:
    if part.joints != model.joints:
        raise ShapeError(f"measurements have {part.joints} joints, the model has {model.joints}")
    return model.regressor(*(x.double() for x in part.inputs))
