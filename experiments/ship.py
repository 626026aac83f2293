"""Puts the 1800 seeds of condition ours, which took long to make, into one file beside their settings.

``python -m sidegan.run +experiment=training scale=paper seeds.shipped=null 'stages=[seeds]'``, then
``python -m experiments.ship``.
"""

from pathlib import Path

from sidegan.pipeline.compose import CONF, composed
from sidegan.pipeline.stages.seeds import origin, seed_set
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.seeds.result import SeedBatch
from sidegan.seeds.shipped import ship


def main() -> None:
    """Write the file that ``seeds.shipped`` names."""
    config = composed("+experiment=training", "scale=paper")
    task = Task(config, Store(Path(config.outputs), Path(config.outputs)))
    made = seed_set(task)
    library, report, costs = task.load(made), task.report(made), task.store.costs(made)
    kept = report["attempts"], report["failed"], report["faults"], costs.get("cpu_seconds", 0.0)
    batch = SeedBatch(library.coefficients, library.fitness, *kept)
    ship(CONF / "seeds" / str(config.seeds.shipped), origin(task), batch)


if __name__ == "__main__":
    main()
