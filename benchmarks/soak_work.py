"""One round of the library's work at a small size, which the soak repeats."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from torch import Tensor

from benchmarks.curves import library_of
from benchmarks.setting import Setting
from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy_in_parts
from sidegan.gan import TrajectoryGenerator, Variant
from sidegan.gan.training import train_variant
from sidegan.identification import RIGID, Noise, TorqueModel, estimate, measure
from sidegan.library import Library
from sidegan.library.stream import Diagonals, save_parts, take
from sidegan.seeds import Gradient
from sidegan.validity import check

_PARTS, _DRAWN, _PICKS = 4, 250, 20
_SEEDS, _STEPS = 10, 15
_RECORDINGS, _RATE = 4, 100.0  # [Hz]
_TRAINED = Variant("soak", epochs=2, steps=5, batch=50, width=64)


@dataclass(frozen=True)
class Work:
    """One round of everything; each round draws anew, and is as large as the one before."""

    setting: Setting
    folder: Path

    def round(self, number: int) -> None:
        """Seeds, a generator trained on them, its library, the selection and the identification."""
        seeds = self.seeds(number)
        generator = self.generator(seeds, number)
        chosen = self.library(generator, number)
        self.identification(chosen.coefficients[:_RECORDINGS], number)

    def seeds(self, number: int) -> Tensor:
        """Coefficients of a batch of seeds, topped up by random ones, (20, 7, 6, 2) [rad/s]."""
        made = Gradient(steps=_STEPS, attempts=1).optimise(
            self.setting.problem, _SEEDS, np.random.SeedSequence(number)
        )
        more = self.setting.problem.start(2 * _SEEDS - len(made), torch.Generator().manual_seed(number))
        return torch.cat([made.coefficients, more])

    def generator(self, seeds: Tensor, number: int) -> TrajectoryGenerator:
        """A generator after a few epochs, written to a file and read from it."""
        path = self.folder / "generator.pt"
        with TemporaryDirectory(dir=self.folder) as work:
            trained = train_variant(
                _TRAINED,
                self.setting.constraints,
                self.setting.trajectory,
                seeds,
                Path(work),
                seed=number,
                evaluation=50,
            )
        trained.generator.save(path)
        return TrajectoryGenerator.load(path, self.setting.arm)

    def library(self, generator: TrajectoryGenerator, number: int) -> Library:
        """The picks from a library that was written part by part and read again."""
        noise = torch.Generator().manual_seed(number)
        path = self.folder / "library.parquet"

        def parts() -> Iterator[Library]:
            for _ in range(_PARTS):
                c = generator.sample(_DRAWN, noise)
                verdict = check(self.setting.constraints, self.setting.trajectory, c)
                found = excite(self.setting.body, self.setting.trajectory, c)
                yield library_of(self.setting, c, verdict, found)

        save_parts(path, parts())
        Library.load(path, self.setting.arm)
        return take(path, greedy_in_parts(Diagonals(path), _PICKS))

    def identification(self, c: Tensor, number: int) -> None:
        """A model from what noisy sensors would see on a few trajectories."""
        family, body = self.setting.trajectory, self.setting.body
        motion = family.roll_out(c, family.times(_RATE))
        noise = Noise("multiplicative", 0.1, torque=True, state=False)
        estimate("ols", TorqueModel(body, RIGID), measure(body, motion, noise, number))
