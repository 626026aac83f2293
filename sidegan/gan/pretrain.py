"""Training of the surrogates on exactly labelled samples, and how good they are on held-out ones."""

from collections.abc import Callable
from itertools import chain

import torch
from torch import Tensor, nn

from sidegan.base.parallel import Report
from sidegan.gan.labels import Labelled
from sidegan.gan.surrogates import Converter, SuccessPredictor

_HELD_OUT = 0.15
_BATCH = 100
_CLASSIFICATION = 0.3  # weight of the valid/faulty loss beside the margins' loss


def split(labelled: Labelled, generator: torch.Generator) -> tuple[Labelled, Labelled]:
    """Training and held-out part."""
    order = torch.randperm(len(labelled.c), generator=generator)
    cut = int(len(order) * (1 - _HELD_OUT))
    return labelled.part(order[:cut]), labelled.part(order[cut:])


def train_predictor(
    predictor: SuccessPredictor,
    data: Labelled,
    epochs: int,
    generator: torch.Generator,
    progress: Report | None = None,
) -> None:
    """Fit the success predictor to margins by moment and to the labels."""

    def loss(rows: Tensor) -> Tensor:
        predicted = predictor.margins(data.c[rows])
        target = data.margins[rows]
        # Near zero, where validity is decided, an error counts most.
        weight = 1 / (0.05 + target.abs())
        margins = (weight * (predicted - target).abs()).mean()
        log_valid = predictor.log_probability(predicted)
        return margins + _CLASSIFICATION * _cross_entropy(log_valid, data.valid[rows])

    _train(predictor, loss, len(data.c), epochs, generator, progress)


def train_converter(
    converter: Converter,
    c: Tensor,
    features: Tensor,
    epochs: int,
    generator: torch.Generator,
    progress: Report | None = None,
) -> None:
    """Fit the converter to true features (N, p), standardised, of coefficients (N, J, H, 2)."""
    converter.fit_standard(features)
    target = converter.standardise(features)

    def loss(rows: Tensor) -> Tensor:
        return nn.functional.smooth_l1_loss(converter(c[rows]), target[rows])

    _train(converter, loss, len(c), epochs, generator, progress)


@torch.no_grad()
def accuracy(predictor: SuccessPredictor, c: Tensor, valid: Tensor) -> float:
    """Share of trajectories whose label the predictor gets right."""
    guess = torch.cat([predictor(part) for part in c.float().split(500)]).exp() > 0.5
    return float((guess == valid).double().mean())


@torch.no_grad()
def explained(converter: Converter, c: Tensor, features: Tensor) -> Tensor:
    """Coefficient of determination R² of each standardised feature, (p,)."""
    predicted = torch.cat([converter(part) for part in c.float().split(500)])
    target = converter.standardise(features)
    return 1 - ((predicted - target) ** 2).mean(0) / target.var(0, unbiased=False).clamp_min(1e-12)


def _cross_entropy(log_valid: Tensor, valid: Tensor) -> Tensor:
    log_faulty = torch.log(-torch.expm1(log_valid.clamp_max(-1e-6)))
    return -torch.where(valid, log_valid, log_faulty).clamp_min(-10).mean()


def _train(
    network: nn.Module,
    loss: Callable[[Tensor], Tensor],
    count: int,
    epochs: int,
    generator: torch.Generator,
    progress: Report | None,
) -> None:
    steps = epochs * -(-count // _BATCH)
    optimiser = torch.optim.Adam(network.parameters(), 2e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3e-3, total_steps=steps)
    network.train()
    orders = (torch.randperm(count, generator=generator) for _ in range(epochs))
    for step, rows in enumerate(chain.from_iterable(order.split(_BATCH) for order in orders)):
        optimiser.zero_grad()
        loss(rows).backward()
        optimiser.step()
        schedule.step()
        if progress is not None:
            progress(step + 1, steps)
    network.eval()
    network.requires_grad_(False)
