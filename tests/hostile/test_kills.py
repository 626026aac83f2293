"""A run that is killed at three points, with its whole group, leaves the files of one that is not."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sidegan.pipeline.run import run_stages
from tests.tiny import TINY, tiny

STAGES = "stages=[seeds,surrogates,gan]", "gan=eigen"
COMMAND = (sys.executable, "-m", "sidegan.run", "+experiment=exp1", *STAGES, *TINY)
KILLS, SEED = 3, 0
UNEQUAL = {".locks", "costs", "runs"}  # folders that tell of times and processes


def files(outputs):
    """The files in the artifacts of a folder of outputs, finished or not, while folders may come and go."""
    paths = [Path(folder, name) for folder, _, names in os.walk(outputs) for name in names]
    return {path for path in paths if path.relative_to(outputs).parts[0] not in UNEQUAL}


def contents(outputs):
    return {str(path.relative_to(outputs)): path.read_bytes() for path in files(outputs)}


def start(outputs):
    return subprocess.Popen(
        [*COMMAND, f"outputs={outputs}"],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.mark.slow
def test_a_run_killed_three_times_ends_like_an_undisturbed_one(tmp_path):
    whole, torn, seen = tmp_path / "whole", tmp_path / "torn", set()
    run_stages(tiny(*STAGES, f"outputs={whole}"), tmp_path, "whole")
    expected = contents(whole)
    for point in sorted(random.Random(SEED).sample(range(1, len(expected) - 1), KILLS)):
        process = start(torn)
        while len(seen) < point and process.poll() is None:  # as many files, of whatever it has written
            seen |= files(torn)
            time.sleep(0.005)
        assert process.poll() is None, "it ended before its kill"
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert start(torn).wait() == 0
    assert contents(torn) == expected
