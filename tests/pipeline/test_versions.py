"""Numbers of a tiny chain, recorded: when one moves, the version of its maker must have been raised.

``python -m tests.pipeline.test_versions`` records them anew.
"""

import json
import sys
import tempfile
from pathlib import Path

import pandas as pd
import pytest

from sidegan.pipeline.graph import VERSIONS, versions, waves
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import stage
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import RESULTS, Task
from tests.tiny import tiny

RECORD = Path(__file__).with_name("recorded.json")
EXPERIMENTS = ("reproduction", "beyond", "quality", "design", "excite", "worth")
TOLERANCE = 0.05  # of a number: trainings amplify the last bits, in which machines differ
# Makers that search or train: of few short searches another processor finds others, a third better or worse.
CHAOTIC = {"paper_seeds", "halves", "compiled_seeds", "starts", "gan", "generator"}
FREE = 0.5  # of their numbers
COUNTED = (
    "success",
    "valid",
    "share",
    "drawn",
    "generated",
    "attempts",
    "failed",
)  # a single one may turn over
FEW = 0.1  # of a count or share
MEASURED = {"timing", "first_set"}  # whose numbers are times


def makers(outputs, run):
    """Numbers of every maker of the tiny experiments, each after those it is made from."""
    artifacts, numbers = [], {}
    for experiment in EXPERIMENTS:
        config = tiny(f"outputs={outputs}", experiment=experiment)
        names = [name for name in config.stages if name not in ("table", *MEASURED)]
        config = tiny(f"outputs={outputs}", f"stages=[{','.join(names)}]", experiment=experiment)
        run_stages(config, run / experiment, "versions")
        task = Task(config, Store(Path(outputs)))
        artifacts += [(one, task.store) for name in names for one in stage(name).artifacts(task)]
        if "seeds" in names:  # those of columns, too
            artifacts += [(one, task.store) for one in stage("seeds").listed(task)]
    stores = {one.digest: store for one, store in artifacts}
    for wave in waves(one for one, _ in artifacts):
        for one in wave:
            folder = stores[one.digest].require(one)
            metrics = one.metrics(folder)
            if not metrics and (folder / RESULTS).exists():
                metrics = pd.read_parquet(folder / RESULTS).mean(numeric_only=True).to_dict()
            last = {key: x[-1] if isinstance(x, list) else x for key, x in metrics.items() if x != []}
            finite = {f"{one.label}/{key}": x for key, x in last.items() if isinstance(x, int | float)}
            numbers.setdefault(one.maker, {}).update(finite)
    return numbers


@pytest.fixture(scope="module")
def computed(outputs, tmp_path_factory):
    return makers(outputs, tmp_path_factory.mktemp("runs"))


def moved(now, then, chaotic=False):
    """Names of the numbers that differ by more than machines do."""
    tolerance, few = (FREE, FREE) if chaotic else (TOLERANCE, FEW)

    def same(key):
        loose = any(word in key for word in COUNTED)
        return now[key] == pytest.approx(then[key], few if loose else tolerance, few if loose else 1e-12)

    return [key for key in sorted({*now, *then}) if key not in now or key not in then or not same(key)]


def test_no_number_moves_without_its_makers_version(computed):
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    for maker, numbers in computed.items():
        assert maker in record, f"maker {maker} is not recorded: python -m tests.pipeline.test_versions"
        if record[maker]["version"] == versions()[maker]:
            differences = moved(numbers, record[maker]["numbers"], maker in CHAOTIC)
            assert not differences, (
                f"numbers of maker {maker} moved, and its version did not: {', '.join(differences[:3])}; "
                f"raise it in {VERSIONS.name}, and record anew: python -m tests.pipeline.test_versions"
            )


def test_every_maker_has_a_version_and_is_recorded(computed):
    assert set(computed) == set(versions()) - MEASURED - {"identify"}
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    assert {maker: one["version"] for maker, one in record.items()} == {
        maker: versions()[maker] for maker in record
    }, "record anew: python -m tests.pipeline.test_versions"


def test_a_number_that_moves_is_noticed():
    then = {"a": 1.0, "b": 0.0, "c": 5.0}
    assert moved({"a": 1.0 + 1e-6, "b": 1e-13, "c": 5.0}, then) == []
    assert moved({"a": 1.1, "b": 0.1, "d": 1.0}, then) == ["a", "b", "c", "d"]
    assert moved({"a": 1.4, "b": 0.0, "c": 8.0}, then, chaotic=True) == ["c"]
    assert moved({"success": 0.55, "nmse": 1.1e-5}, {"success": 0.5, "nmse": 1e-5}) == ["nmse"]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        numbers = makers(folder, Path(folder) / "runs")
    record = {
        maker: {"version": versions()[maker], "numbers": {k: float(f"{x:.6g}") for k, x in one.items()}}
        for maker, one in numbers.items()
    }
    RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"recorded {len(record)} makers in {RECORD}\n")
