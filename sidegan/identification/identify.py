"""From measurements to an identified model, and from that to its test error."""

from collections.abc import Iterable

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.measurements import Measurements, chunks
from sidegan.identification.metrics import nmse
from sidegan.identification.rls import Identified, Rls
from sidegan.identification.sums import Sums, finite
from sidegan.motion.compiled import tensors as kernels
from sidegan.motion.dynamics import RigidBody

SAMPLES_AT_ONCE = 4096  # their regressor of a 7-joint arm takes 10 MB


def identify(
    body: RigidBody,
    measurements: Measurements | Iterable[Measurements],
    prior: float = 1e6,
    forgetting: float = 1.0,
    samples_at_once: int = SAMPLES_AT_ONCE,
) -> Identified:
    """Model identified by recursive least squares with equal weights, as in the paper.

    Args:
        body: the arm; its own parameters are not used.
        measurements: one recording or a stream of them in the order of time, which is read once.
        prior: variance of each parameter before any sample, P₀ = prior · I.
        forgetting: λ in (0, 1].
        samples_at_once: largest number of samples whose regressor is held.

    Raises:
        ConfigError: when the prior, the forgetting factor or ``samples_at_once`` is out of range.
        ShapeError: when there are no samples, or they do not fit the arm.
    """
    return accumulate(body, measurements, prior, forgetting, samples_at_once).solve()


def identify_weighted(
    body: RigidBody,
    measurements: Measurements | Iterable[Measurements],
    prior: float = 1e6,
    forgetting: float = 1.0,
    samples_at_once: int = SAMPLES_AT_ONCE,
) -> Identified:
    """Model identified by weighted least squares, each joint's equations divided by its residual.

    Otherwise the large joints drown the wrist. Arguments and errors are those of ``identify``; the stream
    is read once here too.
    """
    return accumulate(body, measurements, prior, forgetting, samples_at_once).solve_weighted()


def evaluate(
    body: RigidBody,
    identified: Identified,
    measurements: Measurements | Iterable[Measurements],
    samples_at_once: int = SAMPLES_AT_ONCE,
) -> Tensor:
    """Normalised mean squared error of the predicted torque of each joint, (J,).

    Args:
        body: the arm that was identified.
        identified: its model.
        measurements: test recordings that the identification has not seen.
        samples_at_once: largest number of samples whose regressor is held.

    Raises:
        ShapeError: when the model does not fit the arm, or a joint's test torque is constant.
    """
    if identified.parameters.shape != body.base.values.shape:
        found = f"{len(identified.parameters)} parameters, the arm has {len(body.base.values)}"
        raise ShapeError(f"the identified model has {found}")
    pairs = []
    for part in chunks(measurements, samples_at_once):
        y = body.base_regressor(*part.states)
        pairs.append((part.torque, y @ identified.parameters.to(y)))
    if not pairs:
        raise ShapeError("there are no samples to test with")
    return nmse(*(torch.cat(x) for x in zip(*pairs)))


def accumulate(
    body: RigidBody,
    measurements: Measurements | Iterable[Measurements],
    prior: float = 1e6,
    forgetting: float = 1.0,
    samples_at_once: int = SAMPLES_AT_ONCE,
) -> Rls:
    """The recursion after all samples, from which any weighting can be solved; arguments as ``identify``."""
    rls: Rls | None = None
    for part in chunks(measurements, samples_at_once):
        rls = rls or Rls(len(body.base.values), part.joints, prior, forgetting)
        if forgetting == 1 and isinstance(body, RigidBody) and kernels.usable(*part.states, part.torque):
            rls.absorb(_sums(body, part))
        else:
            rls.update(body.base_regressor(*part.states), part.torque)
    if rls is None:
        raise ShapeError("there are no samples to identify from")
    return rls


def _sums(body: RigidBody, part: Measurements) -> Sums:
    """What ``sums_of`` gives, by a compiled kernel that keeps no regressor."""
    body._check(*part.states)
    products = kernels.sums(body.chain, body.base.columns, part.states, part.torque)
    information, moment, energy = products[:, :-1, :-1], products[:, :-1, -1], products[:, -1, -1]
    weight = torch.tensor(float(len(part)), dtype=torch.float64)
    return finite(Sums(information, moment, energy, part.torque.detach().sum(0), weight))
