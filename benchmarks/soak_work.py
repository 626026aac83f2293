"""One round of the library's work at a small size, which the soak repeats."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from torch import Tensor

from benchmarks.curves import library_of
from benchmarks.setting import Setting
from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy_in_parts
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.training import Run, train_variant
from sidegan.identification import Noise, identify, measure
from sidegan.library import Library
from sidegan.library.stream import Diagonals, save_parts, take
from sidegan.seeds import Gradient
from sidegan.validity import check

_PARTS, _DRAWN, _PICKS = 4, 250, 20
_SEEDS, _STEPS = 10, 15
_RECORDINGS, _RATE = 4, 100.0  # [Hz]
_EPOCHS, _GAN_STEPS, _BATCH, _WIDTH = 2, 5, 50, 64  # of the generator


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
        variant = self.setting.variants()["vanilla"]
        variant = replace(variant, epochs=_EPOCHS, steps=_GAN_STEPS, batch=_BATCH, width=_WIDTH)
        physics = self.setting.constraints, self.setting.trajectory
        with TemporaryDirectory(dir=self.folder) as work:
            trained = train_variant(variant, *physics, seeds, Run("soak", number, Path(work), evaluation=50))
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
        identify(body, measure(body, motion, Noise(level=0.1), np.random.default_rng(number)))
