"""Training of the surrogates: label samples with exact physics in parallel, then train each network."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from sidegan.base.arrays import Array, split
from sidegan.base.parallel import Report
from sidegan.design.excitation import measure_excitation
from sidegan.errors import ArtifactError
from sidegan.gan.published import PublishedConverter, PublishedPredictor
from sidegan.gan.reward import Energies
from sidegan.gan.settings import SurrogateSettings, Variant
from sidegan.gan.surrogates import Converter, SuccessPredictor, learn, scores
from sidegan.gan.tensors import keep_freed_memory, numpy_array, read_tensors, write_network
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

_DISTANCE = 0.1  # clearance that counts like half a joint's range [m]
_CLIP = 1.0  # larger scaled margins carry no information about validity
_LABELLED = 250  # samples to label at once
_SMALLEST, _LARGEST = 0.8, 1.2  # range of random scales of the samples

SHARES = 8  # jobs that label the samples
_BATCH, _PEAK_RATE = 100, 3e-3
_HELD_OUT = 0.15  # of the seeds, and of the labelled samples
_HELD_OUT_NEGATIVES = 500
_LEAST_NEGATIVES = 100  # for training


class Labelled(NamedTuple):
    """Samples for the surrogates with exact labels, which the compiled physics makes cheap."""

    c: Array  # coefficients, (N, J, H, 2) float32
    valid: Array  # validity over the whole period, (N,)
    margins: Array  # scaled margins over time, (N, G, T) float32, clipped to ±1
    spectrum: Array  # spectrum of YᵀY, (N, p)
    diagonal: Array  # diagonal of YᵀY, (N, p)
    energies: Array  # of ``reward.Energies``, (N, K); (N, 0) if not requested

    def take(self, rows: Array) -> "Labelled":
        """The samples of these rows."""
        return Labelled(*(x[rows] for x in self))

    @staticmethod
    def join(parts: Iterable["Labelled"]) -> "Labelled":
        """All samples of several parts."""
        return Labelled(*map(np.concatenate, zip(*parts)))


def label(
    constraints: Constraints,
    trajectory: Trajectory,
    c: Array,
    steps: int,
    progress: Report,
    energies: Callable[[Array], Array] | None = None,
) -> Labelled:
    """Exact labels of coefficients (N, J, H, 2), with margins at ``steps`` time points per trajectory."""
    parts = []
    for done, batch in enumerate(split(c, _LABELLED)):
        excitation = measure_excitation(constraints.body, trajectory, batch)
        valid = check(constraints, trajectory, batch).valid
        margins = scaled_margins(constraints, trajectory, batch, steps)
        reward = batch[:, 0, 0, :0] if energies is None else energies(batch)
        single = batch.astype(np.float32)
        parts.append(Labelled(single, valid, margins, excitation.spectrum, excitation.diagonal, reward))
        progress(min(len(c), (done + 1) * _LABELLED), len(c))
    return Labelled.join(parts)


def scaled_margins(constraints: Constraints, trajectory: Trajectory, c: Array, steps: int) -> Array:
    """Smallest margin of each constraint over time, (B, G, T) float32, relative to its limit."""
    times = trajectory.grid(steps)
    motion = [trajectory.derivative(c, times, order) for order in range(constraints.orders)]
    margins = constraints.margins(*(x.reshape(-1, x.shape[2]) for x in motion))
    relative = constraints.relative(margins, _DISTANCE)
    rows = [relative[name].min(1).reshape(len(c), steps) for name in constraints.labels]
    return np.stack(rows, 1).clip(-_CLIP, _CLIP).astype(np.float32)


@dataclass(frozen=True)
class Pretraining:
    """Data and settings for training an arm's surrogates."""

    constraints: Constraints  # the arm in its workspace
    trajectory: Trajectory  # the family of trajectories
    settings: SurrogateSettings  # numbers of samples and epochs, sizes of the networks
    seeds: Array  # coefficients [rad/s], (N, J, H, 2)
    negatives: Array  # at least ``negatives_count`` samples of a vanilla GAN

    def label(self, seed: int, progress: Report) -> Labelled:
        """One of ``SHARES`` shares of the labelled samples.

        Half are seeds, half are samples of the vanilla GAN, each scaled by 0.8 to 1.2: optimised seeds are
        on the boundary of validity, so that scaling puts samples on both sides of it.
        """
        count = -(-self.settings.samples // SHARES)
        seeds, others = self.seeds[: self._learnt], self.negatives[:-_HELD_OUT_NEGATIVES]
        noise = torch.Generator().manual_seed(seed)
        parts = [
            x[numpy_array(torch.randint(len(x), (n,), generator=noise))]
            for x, n in ((seeds, count // 2), (others, count - count // 2))
        ]
        sizes = numpy_array(torch.rand(count, 1, 1, 1, generator=noise, dtype=torch.float64))
        samples = np.concatenate(parts) * (_SMALLEST + (_LARGEST - _SMALLEST) * sizes)
        energies = Energies(self.constraints, self.trajectory, self.seeds)
        steps = self.settings.margin_steps
        return label(self.constraints, self.trajectory, samples, steps, progress, energies)

    def train_success(
        self, labelled: Labelled, folder: Path, seed: int, progress: Report
    ) -> dict[str, float]:
        """Train the success predictor, save it in ``folder``, and return its held-out scores.

        Those of ``scores``, on held-out seeds, faulty samples of the vanilla GAN, and all held-out samples.
        """
        data, held, random = _begin(labelled, seed)
        sizes = {"width": self.settings.width, "steps": self.settings.margin_steps}
        arguments = {"constraints": len(self.constraints.labels), **sizes}
        predictor = SuccessPredictor(self.constraints.arm, self.trajectory, **arguments)
        self._fit(predictor, [torch.tensor(x) for x in (data.c, data.margins, data.valid)], random, progress)
        write_network(folder / "success.pt", predictor.state_dict(), arguments)
        held_seeds, faulty = self.seeds[self._learnt :], self.negatives[-_HELD_OUT_NEGATIVES:]
        faulty = faulty[~check(self.constraints, self.trajectory, faulty).valid]
        return scores(predictor.accepts, held_seeds, faulty, held.c, held.valid)

    def train_features(
        self, features: str, labelled: Labelled, folder: Path, seed: int, progress: Report
    ) -> dict[str, float]:
        """Train the converter to some features, save it in ``folder``, and return its held-out mean R²."""
        data, held, random = _begin(labelled, seed)
        target = torch.tensor(getattr(data, features))
        sizes = {"width": self.settings.width, "steps": self.settings.feature_steps}
        arguments = {"features": target.shape[1], **sizes}
        converter = Converter(self.constraints.arm, self.trajectory, **arguments)
        converter.fit_standard(target)
        self._fit(converter, (torch.tensor(data.c), converter.standardise(target)), random, progress)
        write_network(folder / f"{features}.pt", converter.state_dict(), arguments)
        explained = converter.explained(torch.tensor(held.c), torch.tensor(getattr(held, features)))
        return {f"r2_{features}": float(explained.mean())}

    @property
    def _learnt(self) -> int:
        """Number of seeds to learn from; the others are held out."""
        return max(1, int(len(self.seeds) * (1 - _HELD_OUT)))

    def _fit(
        self,
        network: SuccessPredictor | Converter,
        tensors: Sequence[Tensor],
        random: torch.Generator,
        progress: Report,
    ) -> None:
        """Train by Adam with a one-cycle learning rate, in a new order every epoch."""
        keep_freed_memory()
        count, epochs = len(tensors[0]), self.settings.epochs
        orders = (torch.randperm(count, generator=random) for _ in range(epochs))
        batches = (rows for order in orders for rows in order.split(_BATCH))
        losses = (network.loss(*(x[rows] for x in tensors)) for rows in batches)
        adam = torch.optim.Adam(network.parameters())
        steps = epochs * -(-count // _BATCH)
        rates = torch.optim.lr_scheduler.OneCycleLR(adam, _PEAK_RATE, total_steps=steps)
        learn(losses, steps, adam, progress, rates)


def _begin(labelled: Labelled, seed: int) -> tuple[Labelled, Labelled, torch.Generator]:
    """Training data, held-out data and random numbers of a training."""
    torch.manual_seed(seed)
    random = torch.Generator().manual_seed(seed)
    order = numpy_array(torch.randperm(len(labelled.c), generator=random))
    cut = int(len(order) * (1 - _HELD_OUT))
    return labelled.take(order[:cut]), labelled.take(order[cut:]), random


def negatives_count(samples: int) -> int:
    """Number of samples to draw from a vanilla GAN: half of the labelled ones, or enough to hold some out."""
    return max(samples // 2, _LEAST_NEGATIVES + _HELD_OUT_NEGATIVES)


def load_surrogates(folder: Path, variant: Variant, arm: Arm, trajectory: Trajectory) -> list[nn.Module]:
    """Frozen success predictor and converter of a variant with features, from their folder.

    Raises:
        ArtifactError: when one is missing, damaged, or for a different arm.
    """
    kinds: dict[str, Callable[..., nn.Module]] = {
        "success": partial(SuccessPredictor, arm, trajectory),
        str(variant.features): partial(Converter, arm, trajectory),
    }
    if variant.published is not None:
        kinds = dict(zip(kinds, (PublishedPredictor, PublishedConverter)))
    networks = []
    for name, kind in kinds.items():
        path = folder / f"{name}.pt"
        content = read_tensors(path)
        try:
            networks.append(kind(**content["arguments"]))
            networks[-1].load_state_dict(content["weights"])
        except (LookupError, TypeError, RuntimeError) as error:
            raise ArtifactError(f"{path} does not fit this arm: {error}") from error
        networks[-1].requires_grad_(False).eval()
    return networks
