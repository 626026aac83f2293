"""Kills at random moments: process groups end by SIGKILL; what the rerun leaves equals that of no kill."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

ARMS = {
    "planar2": ("trajectory.harmonics=3", "long.period=32", "long.harmonics=[3,12]", "long.samples=200"),
    "kuka_lwr4": ("long.harmonics=[6]", "long.period=64", "long.samples=320"),
}
_COMMAND = (sys.executable, "-m", "sidegan.run", "+experiment=exp1", "scale=tiny", "tracking=off")
_WORKERS = "parallel.workers=2"
_REACH = 0.6  # of the time of a whole run, within which a kill comes: about every stage is hit in turn
_UNEQUAL = (".locks", "costs", "runs")  # folders that tell of times and processes
_SEMAPHORES = Path("/dev/shm")


class Outcome(NamedTuple):
    """What came of some kills."""

    kills: int
    finished: int  # runs that came to their end after kills
    unequal: list[str]  # files that differ from those of a run without a kill, or are too many or missing
    left: int  # semaphores in shared memory more than before


def killed(arm: str, kills: int, seed: int = 0) -> Outcome:
    """Run the tiny experiment of one arm again and again, killed so often, and compare what it leaves."""
    generator, semaphores = random.Random(seed), _semaphores()
    with TemporaryDirectory() as folder:
        whole, torn = Path(folder, "whole"), Path(folder, "torn")
        began = time.monotonic()
        _start(arm, whole).wait()
        took, expected = time.monotonic() - began, contents(whole)
        done, finished, unequal = 0, 0, [] if expected else [f"{arm}: nothing was made"]
        while done < kills or torn.exists():
            process = _start(arm, torn)
            if done < kills and not _ends(process, generator.uniform(0, _REACH * took)):
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                done += 1
                continue
            finished += 1
            unequal += differences(expected, contents(torn)) + [f"{arm}: failed"] * (process.wait() != 0)
            shutil.rmtree(torn)
    return Outcome(done, finished, unequal, len(_semaphores() - semaphores))


def contents(outputs: Path) -> dict[str, bytes]:
    """What lies in the artifacts of a folder of outputs, and in what is unfinished."""
    files = (path for path in outputs.rglob("*") if path.is_file())
    names = {str(path.relative_to(outputs)): path for path in files}
    return {name: path.read_bytes() for name, path in names.items() if Path(name).parts[0] not in _UNEQUAL}


def differences(expected: dict[str, bytes], found: dict[str, bytes]) -> list[str]:
    """Names that are in one of both alone, or whose bytes differ."""
    return sorted(name for name in {*expected, *found} if expected.get(name) != found.get(name))


def _start(arm: str, outputs: Path) -> subprocess.Popen[bytes]:
    settings = (f"robot={arm}", f"outputs={outputs}", _WORKERS, *ARMS[arm])
    null = subprocess.DEVNULL
    return subprocess.Popen([*_COMMAND, *settings], stdout=null, stderr=null, start_new_session=True)


def _ends(process: subprocess.Popen[bytes], seconds: float) -> bool:
    """Whether a process ends by itself within some seconds."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


def _semaphores() -> set[str]:
    return {path.name for path in _SEMAPHORES.glob("sem.*")}
