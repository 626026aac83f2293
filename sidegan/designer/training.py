"""Training of a generator of starts: distilled from the designer's own trajectories, then exact physics.

Its modes begin as optimised trajectories of the plain situation. A network learns how to move each of them in
other situations, by the slopes of the designer's own penalised goal there.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from sidegan.base.parallel import Report
from sidegan.designer.aim import Aim
from sidegan.designer.descent import Descent, Descents, Penalties
from sidegan.designer.designer import descents_of, prover_of
from sidegan.designer.generator import Generator, features
from sidegan.designer.proof import NEAR_MARGINS
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.designer.settings import DesignerSettings, GeneratorSettings
from sidegan.designer.situation import Situation
from sidegan.designer.starts import Probes
from sidegan.errors import InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Region

Array = np.ndarray

_ROUGH, _STRICT = 30.0, 600.0  # weights of violations, at first and in the end
_GROWS = 0.6  # share of the steps in which they grow
_STEEPEST = 4.0  # norm of a trajectory's gradient that counts
_WARM, _LAST = 200, 0.01  # steps in which the rate grows; share of it that is left
_SPARE = 2  # optimised trajectories of which one becomes a mode
_POLISH, _MEND = 120, 80  # evaluations for each, with rough and strict penalties
_REACH = 0.7  # share of its limits that a joint of their starts uses
_TRIES = 2000  # situations that are drawn for one where the arm can rest
_APART = 0.02  # [m] that it keeps from everything there
_ASKED = 0.6  # share of the situations that request a home, an effort, a period
_SLOWEST, _WEAKEST = 0.3, 0.4  # shares of velocity and torque limits
_NOTHING, _CROWDED, _MORE = 0.25, 0.35, 4  # shares without and with many regions, and how many draws more
_RANKED = 64  # situations by which modes are ranked


@dataclass(frozen=True)
class _Pool:
    """Situations to learn from."""

    seen: Tensor  # (N, E)
    descents: list[Descent]


class Mover(nn.Module):
    """Moves modes in situations; see ``Generator``."""

    def __init__(self, modes: Array, seen: int, width: int, depth: int) -> None:
        super().__init__()
        self.modes = nn.Parameter(torch.from_numpy(modes).float())
        count, size = modes.shape
        self.first, self.last = nn.Linear(seen + count, width), nn.Linear(width, size)
        self.inner = nn.ModuleList(nn.Linear(width, width) for _ in range(depth))
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)

    def forward(self, seen: Tensor, mode: Tensor) -> Tensor:
        """Points (B, J K) of modes (B,) in situations (B, E)."""
        one = nn.functional.one_hot(mode, len(self.modes)).float()
        x = nn.functional.silu(self.first(torch.cat([seen, one], 1)))
        for layer in self.inner:
            x = x + nn.functional.silu(layer(x))
        return self.modes[mode] + self.last(x)

    @torch.no_grad()
    def frozen(self, order: Array) -> Generator:
        """The generator that was learned, its modes in this order."""
        layers = [self.first, *self.inner, self.last]
        arrays = [(one.weight.double().numpy().copy(), one.bias.double().numpy().copy()) for one in layers]
        seen = arrays[0][0].shape[1] - len(order)
        arrays[0][0][:, seen:] = arrays[0][0][:, seen + order]
        return Generator(self.modes.double().numpy()[order], tuple(arrays))


def make_generator(
    constraints: Constraints,
    trajectory: Trajectory,
    designer: DesignerSettings,
    settings: GeneratorSettings,
    seed: np.random.SeedSequence,
    report: Report = lambda done, total: None,
) -> Generator:
    """A generator of starts for an arm in its workspace; the same for a seed.

    Raises:
        InfeasibleError: when there is hardly any situation in which the arm can rest.
    """
    numbers = ArmNumbers(constraints, trajectory)
    descents, random = descents_of(numbers, designer), np.random.default_rng(seed)
    soft = _penalties(settings, _ROUGH)
    pool = _pool(numbers, descents, settings, random)
    modes = _modes(numbers, descents.descent(numbers.scene(Situation()), Aim(), soft), settings, random)
    with torch.random.fork_rng():
        torch.manual_seed(int(random.integers(2**31)))
        mover = Mover(modes, pool.seen.shape[1], settings.width, settings.depth)
    _train(mover, pool, settings, random, report)
    return mover.frozen(_ranking(mover, pool))


def _penalties(settings: GeneratorSettings, weight: float) -> Penalties:
    return Penalties(weight, settings.reserve, settings.reserve, settings.clearance)


def _pool(
    numbers: ArmNumbers, descents: Descents, settings: GeneratorSettings, random: np.random.Generator
) -> _Pool:
    """Situations in which the arm can rest."""
    draw, seen = _Draw(numbers, settings, random), []
    found: list[Descent] = []
    own, soft = numbers.constraints.regions, _penalties(settings, _ROUGH)
    while len(found) < settings.situations:
        situation, scene = draw()
        seen.append(features(numbers, scene, draw.probes.feel((*own, *situation.regions))))
        found.append(descents.descent(scene, Aim(), soft))
    return _Pool(torch.from_numpy(np.stack(seen)).float(), found)


class _Draw:
    """Situations at random: homes, efforts, periods, and from nothing to many regions."""

    def __init__(self, numbers: ArmNumbers, settings: GeneratorSettings, random: np.random.Generator) -> None:
        self.numbers, self.settings, self.random = numbers, settings, random
        self.probes, self._prover = Probes(numbers), prover_of(numbers)

    def __call__(self) -> tuple[Situation, Scene]:
        """One in which the arm can rest, with room around it."""
        for _ in range(_TRIES):
            situation = self._any()
            try:
                scene = self.numbers.scene(situation)
            except InfeasibleError:
                continue
            margins = self._prover.prove(scene, np.zeros_like(scene.size)).margins
            if (margins >= 0).all() and margins[NEAR_MARGINS].min() >= _APART:
                return situation, scene
        raise InfeasibleError(f"of {_TRIES} situations drawn, none lets {self.numbers.arm.name} rest")

    def _any(self) -> Situation:
        numbers, random = self.numbers, self.random
        usual = np.array(numbers.trajectory.home)
        way = self.settings.homes * random.uniform(-1, 1, len(usual)) * (random.random() < _ASKED)
        home = usual + np.where(way > 0, way * (numbers.upper - usual), -way * (numbers.lower - usual))
        limits, period = (1.0, 1.0), None
        if random.random() < _ASKED:
            limits = random.uniform(_SLOWEST, 1.0), random.uniform(_WEAKEST, 1.0)
        if random.random() < _ASKED:
            period = numbers.trajectory.period * 2 ** random.uniform(-1, 1)
        return Situation(home.tolist(), self._regions(), *limits, period)

    def _regions(self) -> list[Region]:
        kind = self.random.random()
        if kind < _NOTHING:
            return []
        regions = self.probes.draw(self.random)
        for _ in range(self.random.integers(1, _MORE, endpoint=True) if kind > 1 - _CROWDED else 0):
            regions += self.probes.draw(self.random)
        return regions


def _modes(
    numbers: ArmNumbers, descent: Descent, settings: GeneratorSettings, random: np.random.Generator
) -> Array:
    """Points (M, J K) of the plain situation: the best of some that were optimised."""
    scene, found = numbers.scene(Situation()), []
    for _ in range(_SPARE * settings.modes):
        descent.penalise(_penalties(settings, _ROUGH))
        descent.place(numbers.start(scene, random, _REACH))
        descent.run(_POLISH)
        descent.penalise(_penalties(settings, _STRICT))
        descent.run(_MEND)
        found.append((descent.goal + descent.cost, descent.x.ravel()))
    found.sort(key=lambda one: one[0])
    return np.stack([x for _, x in found[: settings.modes]])


def _train(
    mover: Mover, pool: _Pool, settings: GeneratorSettings, random: np.random.Generator, report: Report
) -> None:
    optimiser = torch.optim.Adam(mover.parameters(), settings.learning_rate)
    weight = _ROUGH
    for step in range(settings.steps):
        done = step / settings.steps
        wanted = _ROUGH * (_STRICT / _ROUGH) ** min(1.0, done / _GROWS)
        if wanted > 1.2 * weight or (done >= _GROWS and weight < _STRICT):
            weight = wanted
            for one in pool.descents:
                one.penalise(_penalties(settings, weight))
        ease = min(1.0, (step + 1) / _WARM) * (_LAST + 0.5 * (1 + np.cos(np.pi * done)))
        for group in optimiser.param_groups:
            group["lr"] = settings.learning_rate * ease
        rows = random.integers(len(pool.descents), size=settings.batch)
        modes = torch.from_numpy(random.integers(len(mover.modes), size=settings.batch))
        points = mover(pool.seen[rows], modes)
        _, slopes = _slopes([pool.descents[k] for k in rows], points.detach().double().numpy())
        optimiser.zero_grad()
        points.backward(torch.from_numpy(slopes).float() / settings.batch)
        optimiser.step()
        report(step + 1, settings.steps)


def _slopes(descents: list[Descent], points: Array) -> tuple[Array, Array]:
    """Penalised goals (B,) at points (B, J K), and their slopes, none of which is very steep."""
    values, slopes = np.zeros(len(points)), np.zeros_like(points)
    for k, (descent, x) in enumerate(zip(descents, points)):
        shape = descent.x.shape
        gradient = np.zeros(shape)
        values[k] = sum(descent.evaluate(x.reshape(shape), gradient))
        if np.isfinite(values[k]) and np.isfinite(gradient).all():
            slopes[k] = gradient.ravel() / max(1.0, float(np.linalg.norm(gradient)) / _STEEPEST)
    return values, slopes


@torch.no_grad()
def _ranking(mover: Mover, pool: _Pool) -> Array:
    """Modes, the best on the whole first."""
    some = min(_RANKED, len(pool.descents))
    worth = []
    for mode in range(len(mover.modes)):
        points = mover(pool.seen[:some], torch.full((some,), mode)).double().numpy()
        worth.append(float(np.median(_slopes(pool.descents[:some], points)[0])))
    return np.argsort(worth, kind="stable")
