"""Training of the published surrogates: predictor from faulty and valid samples, converters from seeds.

Source: as ``gan.published``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from sidegan.base.parallel import Report
from sidegan.base.storage import read_torch, write_task
from sidegan.errors import ArtifactError
from sidegan.gan.published import ShallowNetwork, converter_network, predictor_network
from sidegan.gan.surrogates import PublishedSurrogates, Surrogates
from sidegan.gan.variants import Variant
from sidegan.seeds.published import Layout
from sidegan.validity import Validity

_BATCH, _RATE = 100, 1e-4
_HELD_OUT = 0.2  # of the samples and of the seeds
_SUCCESS = "success"
_CHECKED = 500  # trajectories whose validity is found at once


@dataclass(frozen=True)
class PublishedPretraining:
    """What the published surrogates learn from, and how."""

    check: Callable[[Tensor], Validity]  # of coefficients (B, J, H, 2)
    layout: Layout
    settings: PublishedSurrogates
    seeds: Tensor  # coefficients [rad/s], (N, J, H, 2)
    features: dict[str, Tensor]  # of the seeds, (N, p): spectrum and diagonal
    samples: Tensor  # images (M, 2, 7, 7) of a vanilla GAN, of all of its epochs

    def train_success(
        self, folder: Path, seed: int, weights: dict[str, Tensor] | None, progress: Report
    ) -> dict[str, float]:
        """Held-out accuracies of the success predictor in ``folder``, trained or of given weights.

        ``accuracy_broad`` is over samples that it has not seen, ``accuracy_paper`` over the seeds and the
        faulty ones among these; ``valid_samples`` is the share of valid ones in all.
        """
        torch.manual_seed(seed)
        parts = self.layout.coefficients(self.samples.double()).split(_CHECKED)
        valid = torch.cat([self.check(part).valid for part in parts])
        held, learnt = _split(len(valid))
        network = predictor_network()

        def loss(rows: Tensor) -> Tensor:
            logits = network(self.samples[rows])[:, 0]
            return nn.functional.binary_cross_entropy_with_logits(logits, valid[rows].float())

        if weights is None:
            _train(network, loss, learnt, self.settings.steps, progress)
        else:
            network.load_state_dict(shipped_weights(weights))
        write_task(folder / f"{_SUCCESS}.pt", {"weights": network.state_dict()})
        with torch.no_grad():
            right = (network(self.samples[held])[:, 0] > 0) == valid[held]
            faulty = ~valid[held]
            of_seeds = network(self.layout.image(self.seeds).float())[:, 0] > 0
        told = torch.cat([of_seeds, right[faulty]]).double().mean()
        return {
            "accuracy_broad": float(right.double().mean()),
            "accuracy_paper": float(told),
            "valid_samples": float(valid.double().mean()),
        }

    def train_features(self, name: str, folder: Path, seed: int, progress: Report) -> dict[str, float]:
        """Mean relative error on held-out seeds of the converter to ``name``, which is left in ``folder``."""
        torch.manual_seed(seed)
        images, target = self.layout.image(self.seeds).float(), self.features[name].float()
        held, learnt = _split(len(target))
        network = converter_network(target.shape[1])
        network.scale.copy_(target.median(0).values)

        def loss(rows: Tensor) -> Tensor:
            return ((network(images[rows]) - target[rows]).abs() / target[rows]).mean()

        _train(network, loss, learnt, self.settings.steps, progress)
        write_task(folder / f"{name}.pt", {"weights": network.state_dict()})
        with torch.no_grad():
            return {f"error_{name}": float(loss(held))}


def _split(count: int) -> tuple[Tensor, Tensor]:
    """Rows that are held out, and those that are learnt from, at random."""
    order = torch.randperm(count)
    held = int(_HELD_OUT * count)
    return order[:held], order[held:]


def _train(
    network: nn.Module, loss: Callable[[Tensor], Tensor], rows: Tensor, steps: int, progress: Report
) -> None:
    """So many steps of Adam, each on a batch of rows drawn anew."""
    optimiser = torch.optim.Adam(network.parameters(), _RATE, fused=True)
    for step in range(steps):
        optimiser.zero_grad()
        loss(rows[torch.randperm(len(rows))[:_BATCH]]).backward()
        optimiser.step()
        if step % 100 == 99 or step == steps - 1:
            progress(step + 1, steps)


def shipped_weights(weights: dict[str, Tensor]) -> dict[str, Tensor]:
    """The authors' weights as those of a network here, whose outputs have a unit."""
    return {"scale": torch.ones(len(weights["fc2.bias"])), **weights}


def load_published(folder: Path | None, variant: Variant) -> Surrogates:
    """Frozen surrogates that a variant of the published recipe learns from, as far as it does.

    Raises:
        ArtifactError: when one is missing or damaged.
    """
    predictor = converter = None
    if folder is not None and variant.weights.success > 0:
        predictor = _frozen(predictor_network(), folder / f"{_SUCCESS}.pt")
    if folder is not None and variant.features != "none":
        path = folder / f"{variant.features}.pt"
        converter = _frozen(converter_network(len(read_torch(path)["weights"]["fc2.bias"])), path)
    return Surrogates(predictor, converter)


def _frozen(network: ShallowNetwork, path: Path) -> ShallowNetwork:
    content: dict[str, Any] = read_torch(path)
    try:
        network.load_state_dict(content["weights"])
    except RuntimeError as error:
        raise ArtifactError(f"{path} is no published surrogate: {error}") from error
    return network.eval().requires_grad_(False)
