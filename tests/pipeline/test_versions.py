"""Numbers stay: whichever process finds them, in which memory, and as long as no maker's version is raised.

Makers that search or train are not watched, since where a search ends differs from one processor to another;
picks are goldens.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from sidegan.library.measure import library_of
from sidegan.pipeline.artifact import Build
from sidegan.pipeline.context import EXPECTED, FACTS, LIBRARY, RESULTS, RunContext
from sidegan.pipeline.stages.baselines import random_set, random_valid
from sidegan.pipeline.stages.identification import identification, plant
from sidegan.pipeline.stages.replication import compared_sets, regression_sums, replication
from sidegan.pipeline.stages.selection import ExcitationSet
from sidegan.pipeline.store import Store
from tests.golden.make import draw
from tests.tiny import tiny

GARBAGE = {"MALLOC_PERTURB_": "165"}  # in every byte that is allocated, and in every one that is freed


def _save(library, task, build):
    library.save(build.folder / LIBRARY)


def digests(*names: str) -> dict[str, str]:
    """SHA-256 of what stages plant and identification find of sets, made in this order."""
    found = {}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            context = RunContext(tiny(f"outputs={folder}", "trajectory.period=4"), Store(Path(folder)))
            c = random_valid(context, 4, name).coefficients
            library = library_of(context.cell.constraints, context.cell.trajectory, c, name)
            source = context.artifact("random", name, partial(_save, library), {"name": name})
            context.store.produce(source)
            excitation = ExcitationSet(name, None, context.cell.trajectory, source)
            for stage in (plant, identification):
                build = Build(Path(folder, stage.__name__), Path(folder), lambda done, total: None)
                build.folder.mkdir()
                stage(context, excitation).make(build)
                content = (build.folder / RESULTS).read_bytes()
                found[f"{name}/{stage.__name__}"] = hashlib.sha256(content).hexdigest()
    return found


def test_another_process_with_garbage_memory_gives_the_same_bits():
    here = digests("first", "second")
    code = "import json; from tests.pipeline.test_versions import *; print(json.dumps(digests('second')))"
    variables = {**os.environ, **GARBAGE, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": "7"}
    process = subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    found = json.loads(process.stdout.splitlines()[-1])
    assert found == {name: digest for name, digest in here.items() if name.startswith("second")}


RECORDED = {
    "identification": {
        "expected/nmse": 0.000104937134,
        "results/nmse": 5.44514199e-06,
        "facts/covariance_norm": 0.00094240276,
        "facts/condition": 621.553249,
        "facts/samples": 3864.0,
    },
    "replication": {
        "results/nmse": 7.76521503e-05,
        "facts/covariance_norm": 0.000448676287,
        "facts/samples": 12696.0,
    },
}
COLUMNS = ("nmse", "covariance_norm", "condition", "samples")


@pytest.fixture
def fixed(context, monkeypatch):
    """A context whose seeds and libraries are the same 24 trajectories on every machine."""
    made = context("gan=eigen", experiment="reproduction")
    c = draw(1, 24, 2, 3, 2) / np.array([1.0, 2.0, 3.0])[:, None]
    library = library_of(made.cell.constraints, made.cell.trajectory, c, "fixed")
    monkeypatch.setattr(type(made), "load", lambda self, *artifacts: library)
    return made


def means(context, artifact, files):
    """Means of an artifact's numbers over weightings, joints, noise and tests."""
    context.store.produce(artifact)
    tables = {file.partition(".")[0]: context.frame(artifact, file) for file in files}
    keys = [(name, key) for name, table in tables.items() for key in COLUMNS if key in table]
    return {f"{name}/{key}": tables[name][key].mean() for name, key in keys}


def identified(context):
    excitation = ExcitationSet("fixed", None, context.cell.trajectory, random_set(context))
    return means(context, identification(context, excitation), (EXPECTED, RESULTS, FACTS))


def replicated(context):
    for pool in compared_sets(context):
        context.store.produce(regression_sums(context, pool, "all"))
    return means(context, replication(context, "all"), (RESULTS, FACTS))


WATCHED = {"identification": identified, "replication": replicated}


@pytest.mark.parametrize("makers", WATCHED)
def test_results_change_only_with_their_makers_version(fixed, makers):
    found, recorded = WATCHED[makers](fixed), RECORDED[makers]
    assert list(found) == list(recorded)
    for key, x in found.items():
        remedy = f"{key} of {makers} is {x!r}: raise its version in params.yaml, and record it here anew"
        assert x == pytest.approx(recorded[key], rel=1e-6), remedy
