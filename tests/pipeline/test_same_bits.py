"""What a stage finds does not depend on which process finds it, after what else, in which memory."""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch

from sidegan.library.measure import measured
from sidegan.pipeline.graph import Build
from sidegan.pipeline.stages.identification import identification
from sidegan.pipeline.stages.plant import plant
from sidegan.pipeline.stages.pools import ExcitationSet
from sidegan.pipeline.stages.random import random_set, random_valid
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import RESULTS, Task
from tests.threads import several_threads
from tests.tiny import tiny

NAMES = ("first", "second")
GARBAGE = {"MALLOC_PERTURB_": "165"}  # in every byte that is allocated, and in every one that is freed
LINE = 8  # numbers of a line of the cache


def shifted(x: torch.Tensor, by: int) -> torch.Tensor:
    """The same numbers in memory that begins so many numbers after a line of the cache."""
    room = np.zeros(x.numel() + 2 * LINE)
    first = -room.ctypes.data // 8 % LINE + by
    place = torch.from_numpy(room[first : first + x.numel()]).reshape(x.shape)
    return place.copy_(x)


def digests(names: list[str], shift: int = 0) -> dict[str, str]:
    """SHA-256 of what stages plant and identification find of two sets, made in this order."""
    found = {}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            task = Task(tiny(f"outputs={folder}", "trajectory.period=4"), Store(Path(folder)))
            c = shifted(random_valid(task, 4, name).coefficients, shift)
            library = measured(task.constraints, task.trajectory, c, name)
            task.__dict__["load"] = lambda artifact, library=library: library
            one = ExcitationSet(name, None, name, task.trajectory, random_set(task))
            for stage in (plant, identification):
                build = Build(Path(folder, stage.__name__), Path(folder), lambda done, total: None)
                build.folder.mkdir()
                stage(task, one).make(build)
                content = (build.folder / RESULTS).read_bytes()
                found[f"{name}/{stage.__name__}"] = hashlib.sha256(content).hexdigest()
    return found


@pytest.fixture(scope="module")
def here():
    return digests([*NAMES])


def test_sets_may_come_in_any_order_in_one_process(here):
    assert digests([*reversed(NAMES)]) == here


def test_numbers_may_lie_anywhere_in_memory(here):
    assert digests([*NAMES], shift=3) == here


def test_several_threads_change_nothing(here):
    with several_threads():
        assert digests([*NAMES]) == here


def test_another_process_finds_the_same_of_one_set_alone_in_memory_full_of_garbage(here):
    code = "import json; from tests.pipeline.test_same_bits import *; print(json.dumps(digests(['second'])))"
    variables = {**os.environ, **GARBAGE, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": "7"}
    process = subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    assert json.loads(process.stdout).items() <= here.items()
