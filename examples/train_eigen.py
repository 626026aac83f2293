"""The eigen variant trained on a seed set: surrogates first, then the adversarial loop, all of it small."""

from pathlib import Path
from tempfile import TemporaryDirectory

import sidegan as sg

cell = sg.Cell("planar2", harmonics=3, period=8, workspace={"desk": None})
seeds = sg.seeds(cell, 100, settings={"steps": 30}, workers=1)

small = {"epochs": 4, "steps": 10, "width": 64, "noise": 20, "batch": 50}
with TemporaryDirectory() as folder:
    networks = {"width": 16, "margin_steps": 16, "feature_steps": 16}
    told = sg.surrogates(cell, seeds, folder, samples=400, epochs=4, **networks, workers=1)
    print({name: round(x, 3) for name, x in told.items()})
    generator = sg.train("eigen", cell, seeds, surrogates=folder, **small)
    generator.save(Path(folder, "eigen.pt"))
    again = sg.Generator.load(Path(folder, "eigen.pt"), cell)
made = sg.TrajectorySet.of(cell, again.sample(500, seed=1))
print(f"{made.valid.mean():.0%} are valid")
