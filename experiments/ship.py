"""Write the 1800 seeds of condition ours, which take long to compute, with their parameters into a file.

``python -m sidegan.run +experiment=training scale=paper seeds.shipped=null 'stages=[seeds]'``, then
``python -m experiments.ship``.
"""

from pathlib import Path

from sidegan.base.conf import CONF
from sidegan.pipeline.compose import composed
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages.seeds import origin, seed_set
from sidegan.pipeline.store import Store
from sidegan.seeding.optimise import SeedBatch, ship


def main() -> None:
    """Write the file that ``seeds.shipped`` names."""
    config = composed("+experiment=training", "scale=paper")
    run = RunContext(config, Store(Path(config.outputs), Path(config.outputs)))
    made = seed_set(run)
    library = run.load(made)
    report = run.report(made)
    costs = run.store.costs(made)
    kept = report["attempts"], report["failed"], report["faults"], costs.get("cpu_seconds", 0.0)
    batch = SeedBatch(library.coefficients, library.fitness, *kept)
    ship(CONF / "seeds" / str(config.seeds.shipped), origin(run), batch)


if __name__ == "__main__":
    main()
