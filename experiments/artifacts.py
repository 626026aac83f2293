"""What the experiments read from the artifacts of a run, as tables."""

from typing import Any

import pandas as pd

from sidegan.plan import FACTS, HISTORY, REPORT, RESULTS, SEEDS, Task
from sidegan.storage import read_json


def errors(task: Task) -> pd.DataFrame:
    """NMSE and facts of every excitation set, by set, training, repeat, weighted and joint."""
    found = []
    for name, training in task.sets():
        folder = task.store.require(task.identification(name, training))
        results, facts = (pd.read_parquet(folder / file) for file in (RESULTS, FACTS))
        found.append(results.merge(facts, on=["set", "training", "repeat"]))
    return pd.concat(found, ignore_index=True).assign(seed=task.cfg.seed)


def histories(task: Task) -> dict[str, list[list[dict[str, float | None]]]]:
    """Metrics after every epoch of every training of each variant."""
    return {
        name: [
            read_json(task.store.require(task.gan(name, settings, k)) / HISTORY) for k in task.cfg.trainings
        ]
        for name, settings in task.cfg.gan.items()
    }


def generators(task: Task) -> pd.DataFrame:
    """Validity, fitness and diversity of the seeds and of every training of each generator, a row each."""
    rows: list[dict[str, Any]] = [
        {"name": SEEDS, "training": 0, **read_json(task.store.require(task.seeds) / REPORT)}
    ]
    for name, runs in histories(task).items():
        for training, history in zip(task.cfg.trainings, runs):
            last = history[-1]
            kept = read_json(task.store.require(task.library(name, training)) / REPORT)
            # A library holds what is valid: its condition is not that of all that the generator makes.
            known = last | kept | {"condition": last["condition"], "condition_valid": kept["condition"]}
            rows.append({"name": name, "training": training, **known})
    return pd.DataFrame(rows)
