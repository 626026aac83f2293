"""Estimators on the same recordings: what their models are worth on the tasks, what their intervals hold."""

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidegan.identification import Measurements, estimate
from sidegan.plant.varied import VariedPlant
from sidegan.worth.curves import Judge, Truth, disturbed, executed, mean_error
from sidegan.worth.intervals import Lacking, bias, held, recurring, true_parameters
from sidegan.worth.orders import SetOf
from sidegan.worth.settings import PIECE, Regime, WorthSettings

# Of methods that need more than numbers.
_OPTIONS: dict[str, dict[str, Any]] = {"consistent": {"pull": "logdet", "strength": None, "total_mass": None}}
_LEAST = 1e-9  # of a parameter's information: what was not excited at all stays finite


class Judged(NamedTuple):
    """What an estimator made of a recording."""

    error: float  # on the tasks, relative
    covered: float  # share of the true parameters that its 95 % intervals hold
    widened: float  # the same of intervals that allow for what the model lacks


def compared(
    judge: Judge, plant: VariedPlant, made: SetOf, truth: Truth, regime: Regime, outliers: bool, seed: int
) -> dict[str, Judged]:
    """Estimators on a set executed twice; with outliers, some samples of the torques are far off."""
    settings, random = judge.settings, np.random.default_rng(seed)
    twice = [recorded(judge, plant, made, regime, outliers, random) for _ in range(2)]
    recordings = [one for run in twice for one in run]
    true, found = true_parameters(plant, judge.model), {}
    for method, options in settings.estimators.items():
        one = estimate(method, judge.model, recordings, **_OPTIONS.get(method, {}), **(options or {}))
        off = _bias(judge, plant, recordings, one.parameters, one.weights)
        both = one.deviation, (one.deviation.square() + off.square()).sqrt()
        shares = (float(held(one.parameters, deviation, true)) for deviation in both)
        found[method] = Judged(float(mean_error(truth.errors(one.parameters))), *shares)
    return found


def recorded(
    judge: Judge,
    plant: VariedPlant,
    made: SetOf,
    regime: Regime,
    outliers: bool,
    random: np.random.Generator,
) -> list[Measurements]:
    """A recording of each trajectory of a set."""
    states, torque, friction = executed(plant, made, judge.settings.sensors)
    each = round(made.family.period / PIECE)
    parts = friction.unflatten(1, (each, -1)).flatten(0, 1)
    noise = disturbed(parts, plant.scale, judge.settings.sensors, regime.drift, each, random)
    torque = torque + noise.view_as(torque)
    if outliers:
        torque = torque + torch.from_numpy(_outliers(judge.settings, plant, tuple(torque.shape), random))
    return [Measurements(*one) for one in zip(*states, torque)]


def _outliers(
    settings: WorthSettings, plant: VariedPlant, shape: tuple[int, ...], random: np.random.Generator
) -> np.ndarray:
    """Single samples that are off by a joint's whole torque or so."""
    hit = random.random(shape) < settings.outliers
    return hit * random.standard_normal(shape) * plant.scale


def _bias(
    judge: Judge, plant: VariedPlant, recordings: list[Measurements], parameters: Tensor, weights: Tensor
) -> Tensor:
    """Deviations (P,) that come of what the model lacks, of weights (J,), of recordings in two equal runs."""
    count = len(recordings) // 2
    y = torch.stack([judge.model.regressor(*one.inputs) for one in recordings])
    residuals = torch.stack([one.torque for one in recordings]) - y @ parameters
    q, dq = (torch.stack([getattr(one, name) for one in recordings]) for name in ("position", "velocity"))
    rigid = y[..., : judge.model.rigid] @ judge.model.body.base.values
    lacks = Lacking.along(y.flatten(0, 1), judge.lacking(plant, q, dq, rigid).flatten(0, 1))
    rows = y.flatten(0, 1).transpose(0, 1)
    information, variance = rows.mT @ rows, 1 / weights.square()
    least = _LEAST * (information / variance[:, None, None]).sum(0).diagonal().diag()
    coming = recurring(residuals, torch.arange(2 * count) % count)
    return bias(lacks, information, variance, least, coming)
