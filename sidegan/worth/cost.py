"""What a study takes, from the pace of a few of its parts: told before it begins."""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import torch

from sidegan.design.prediction import Prediction
from sidegan.design.sequence import value_and_gradient
from sidegan.identification.model import states_within
from sidegan.plant.varied import VariedPlant
from sidegan.worth.contenders import DESIGNED, aim_of
from sidegan.worth.curves import Judge
from sidegan.worth.orders import Order
from sidegan.worth.settings import Contender, WorthSettings

_STEPS, _MOTIONS, _STATES = 60, 20, 2_000  # of what is timed


class Pace(NamedTuple):
    """CPU time [s] of the parts of a study."""

    step: float  # of the physics, whatever moves
    motion: float  # of each motion in it
    state: float  # that a plant is identified from
    gradient: float  # of one state of a set that is designed for the error on tasks


class Cost(NamedTuple):
    """CPU time [s] of a study of one arm."""

    design: float  # of the sets that are designed one trajectory after another; others take next to nothing
    plants: float  # that move, and are identified

    @property
    def total(self) -> float:
        """Both."""
        return self.design + self.plants


def pace(judge: Judge, plant: VariedPlant, order: Order) -> Pace:
    """How long parts take here, timed."""
    family, problem, aim = order.family(), order.problem(), aim_of(order, Prediction)
    times = torch.arange(_STEPS, dtype=torch.float64) / plant.settings.rate

    def follow(count: int) -> None:
        plant.follow(family.roll_out(torch.zeros(count, *family.shape, dtype=torch.float64), times))

    settings = order.settings
    count = settings.search.starts * settings.sets  # all sets are designed at once
    states, c = states_within(plant.arm, _STATES), problem.start(count, order.generator)
    samples = 2 * family.harmonics + 1

    def identify() -> object:
        y = judge.model.regressor(*states).transpose(0, 1)
        return y.mT @ y

    follow(1)
    one, many = (_seconds(partial(follow, n)) / _STEPS for n in (1, 1 + _MOTIONS))
    motion = max(0.0, many - one) / _MOTIONS
    gradient = _seconds(lambda: value_and_gradient(problem, aim, c, samples)) / (count * samples)
    return Pace(max(one - motion, 0.0), motion, _seconds(identify) / _STATES, gradient)


def cost(settings: WorthSettings, contenders: Mapping[str, Contender], pace: Pace) -> Cost:
    """What the study of one arm takes on which these contend."""
    forms = {settings.regimes[name].form for name in settings.judged}
    others = {one.form for name, one in settings.regimes.items() if name not in settings.judged}
    each = [_each(settings, one, pace) for one in contenders.values()]
    moved = settings.plants * len(forms) + min(settings.plants, settings.compared) * len(others)
    return Cost(sum(x.design for x in each), moved * sum(x.plants for x in each))


def _each(settings: WorthSettings, one: Contender, pace: Pace) -> Cost:
    """Of one contender: the design of its sets, and one plant with one form of friction."""
    motions = settings.sets * settings.count(one)
    moved = one.period * settings.plant.rate * (pace.step + pace.motion * motions)
    identified = motions * one.period * settings.sensors.rate * pace.state
    search = settings.search
    evaluated = search.starts * (0.5 * search.rough + search.strict) * search.samples * one.period
    design = motions * evaluated * pace.gradient if one.maker in DESIGNED else 0.0
    return Cost(design, moved + identified)


def _seconds(work: Callable[[], object]) -> float:
    """CPU time of some work [s]."""
    began = time.process_time()
    work()
    return time.process_time() - began
