"""Numbers stay, whichever process finds them, in which memory."""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

from sidegan.library.measure import library_of
from sidegan.pipeline.artifact import Build
from sidegan.pipeline.context import LIBRARY, RESULTS, RunContext
from sidegan.pipeline.stages.baselines import random_valid
from sidegan.pipeline.stages.identification import identification, plant
from sidegan.pipeline.stages.selection import ExcitationSet
from sidegan.pipeline.store import Store
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
