"""The eigen variant trained on a seed set: surrogates first, then the adversarial loop."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from sidegan.design.problem import Problem
from sidegan.gan.labels import Labelled
from sidegan.gan.pretraining import SHARES, Pretraining, load_surrogates, negatives_count
from sidegan.gan.settings import SurrogateSettings, Variant, Weights
from sidegan.gan.side_gan import Data
from sidegan.gan.training import Run, train
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.seeding import Gradient
from sidegan.validity import Constraints, check

arm = load_robot("planar2")
constraints, family = Constraints(arm, []), Trajectory(arm.joints, harmonics=3, period=8.0)
seeds = Gradient(30, 5, reserve=0.2).optimise(Problem(constraints, family), 100, np.random.SeedSequence(0))
data = Data(constraints, family, seeds.coefficients)

weights = Weights(adversarial=0.3, features=0.3, success=150, fitness=60, distance=250, rank=200, offset=600)
eigen = Variant("Eigen", weights, epochs=4, steps=10, width=64, noise=20, batch=50, boxed=False)
vanilla = replace(eigen, variant="Vanilla", weights=replace(weights, features=0, success=0, fitness=0))
surrogates = SurrogateSettings("ours", {"vanilla": vanilla}, 400, 4, 16, 16, 16)

with TemporaryDirectory() as folder:
    work = Path(folder)
    faulty = train(vanilla, data, Run("vanilla", 0, work / "vanilla")).generator.sample(negatives_count(400))
    pretraining = Pretraining(constraints, family, surrogates, seeds.coefficients, faulty)
    labelled = Labelled.join(pretraining.label(share, print) for share in range(SHARES))
    pretraining.train_success(labelled, work, 0, print)
    print(pretraining.train_features("spectrum", labelled, work, 0, print))
    data = Data(constraints, family, seeds.coefficients, *load_surrogates(work, eigen, arm, family))
    generator = train(eigen, data, Run("eigen", 0, work / "eigen")).generator
print(f"{check(constraints, family, generator.sample(500, seed=1)).valid.double().mean():.0%} are valid")
