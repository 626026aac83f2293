r"""Training and sampling by the processor and by a GPU, as wall times: one JSON object.

    python -m benchmarks.device                    # where sidegan is installed
    python -m benchmarks.device save task.pt       # there, for another machine with a GPU, which
    python -m benchmarks.device task.pt            # needs torch, pytorch-lightning, numba, scipy, pydantic

Training is that of variant eigen with untrained surrogates, without the physics after every epoch: that is
the processor's work wherever the networks run.
"""

import json
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Literal

import numpy as np
import pytorch_lightning as pl
import torch
from torch.utils.data import DataLoader, RandomSampler

from sidegan.gan.side_gan import Data

SEEDS, EPOCHS, WARM = 1800, 2, 1
_SAMPLES, _BATCHES = 20_000, 5


def task() -> tuple[Any, Data]:
    """Variant eigen, and what it learns from: random seeds of the LWR."""
    from sidegan.design.excitation import measure_excitation
    from sidegan.design.problem import Problem
    from sidegan.gan.surrogates import Converter, SuccessPredictor
    from sidegan.motion.trajectory import Trajectory
    from sidegan.pipeline.compose import composed
    from sidegan.robot import load_robot
    from sidegan.validity import Constraints, Plane

    cfg = composed("+experiment=exp1", "scale=paper")
    constraints = Constraints(load_robot("kuka_lwr4"), [Plane((0.0, 0.0, 1.0), 0.10)])
    family = Trajectory(constraints.arm.joints)
    arm = constraints.arm
    sizes = cfg.surrogates
    seeds = Problem(constraints, family).start(SEEDS, np.random.default_rng(0))
    spectrum = measure_excitation(constraints.body, family, seeds[:200]).spectrum
    predictor = SuccessPredictor(arm, family, len(constraints.labels), sizes.width, sizes.margin_steps)
    converter = Converter(arm, family, spectrum.shape[1], sizes.width, sizes.feature_steps)
    converter.fit_standard(torch.tensor(spectrum))
    for network in (predictor, converter):
        network.requires_grad_(False)
    variant = replace(cfg.gan["eigen"], epochs=EPOCHS, fitness_start=0)
    return variant, Data(constraints, family, seeds, predictor, converter)


def rates(variant: Any, data: Data, device: Literal["cpu", "cuda"]) -> dict[str, float]:
    """Wall time of an epoch [s] and of a sample [µs] on a device."""
    model = resolve_name(variant._target_)(variant, data)
    rows: Any = range(len(data.seeds))
    order = RandomSampler(rows, num_samples=model.steps * variant.generator.batch)

    def train(epochs: int) -> None:
        batches: DataLoader[Any] = DataLoader(rows, variant.generator.batch, sampler=order)
        quiet: Any = dict.fromkeys(("logger", "enable_checkpointing", "enable_progress_bar"), False)
        trainer = pl.Trainer(
            max_epochs=epochs, accelerator=device, devices=1, enable_model_summary=False, **quiet
        )
        trainer.fit(model, batches)
        model.cpu()

    train(WARM)
    before = [x.detach().clone() for x in model.generator.parameters()]
    epoch = _seconds(lambda: train(EPOCHS)) / EPOCHS
    moved = any(not torch.equal(x, y) for x, y in zip(before, model.generator.parameters()))
    assert moved, "nothing was learned"
    generator = model.generator.eval().to(device)
    generator.sample(_SAMPLES)
    sample = _seconds(lambda: [generator.sample(_SAMPLES) for _ in range(_BATCHES)]) / (_SAMPLES * _BATCHES)
    return {"epoch": epoch, "sample": 1e6 * sample}


def measured(variant: Any, data: Data) -> dict[str, Any]:
    """Rates by the name of each device that is there."""
    names: dict[Literal["cpu", "cuda"], str] = {"cpu": platform.processor() or platform.machine()}
    if torch.cuda.is_available():
        names["cuda"] = torch.cuda.get_device_name()
    return {str(device): {"name": name, **rates(variant, data, device)} for device, name in names.items()}


def _seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main(words: list[str]) -> None:
    """Measure, or save what another machine measures with."""
    if words[:1] == ["save"]:
        torch.save(task(), words[1])
        return
    # Our own file, made by the line above on another machine.
    made = torch.load(Path(words[0]), weights_only=False) if words else task()
    sys.stdout.write(json.dumps(measured(*made)) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
