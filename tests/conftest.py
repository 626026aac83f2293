import logging
import os
import re
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest
from threadpoolctl import threadpool_limits

from sidegan.base.settings_text import command_messages
from sidegan.robot import Arm, load_robot

from .refusals import said

os.environ["OMP_NUM_THREADS"] = "1"  # of workers and commands that tests start
os.environ["LOKY_MAX_CPU_COUNT"] = "1"  # tests run in parallel already; starting workers takes seconds
threadpool_limits(1)
# A busy machine is no failure: neither slow examples nor drawing them slowly.
SLOW = [hypothesis.HealthCheck.too_slow]
hypothesis.settings.register_profile("search", deadline=None, suppress_health_check=SLOW)
# The same examples every time, so that whoever sets up sees what we saw. Others: --hypothesis-profile=search
hypothesis.settings.register_profile("usual", hypothesis.settings.get_profile("search"), derandomize=True)
hypothesis.settings.load_profile("usual")

# Files that take longest: a parallel run begins with them, or one process works at its end while others idle.
LONGEST = ("test_lab_day.py", "experiments/", "hostile/", "pipeline/", "validity/", "base/test_parallel.py")

# Why a test may be skipped: an extra, a program or a recording that is not on this machine.
SKIPS = re.compile(
    r"no CUDA device|not at hand|its recordings are not in|example-robot-data"
    r"|needs a browser|needs a compiler|needs root|no clone"
    r"|could not import '(dvc|xacro|xacrodoc|hydra_plugins\.hydra_submitit_launcher)\b"
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """A file for the messages of all refusals, to be read by a person."""
    parser.addoption("--messages", type=Path, metavar="FILE", help="write the messages of refusals to a file")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Add this process's messages to the file."""
    if file := session.config.getoption("--messages"):
        with Path(file).open("a", encoding="utf-8") as stream:
            stream.writelines(f"{message}\n" for message in said())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """A test that is skipped for any other reason fails."""
    report = yield
    if report.skipped and isinstance(report.longrepr, tuple) and not SKIPS.search(report.longrepr[2]):
        report.outcome, report.longrepr = "failed", f"unexpected skip: {report.longrepr[2]}"
    return report


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Longest files first."""

    def place(item: pytest.Item) -> int:
        path = item.path.as_posix()
        return next((k for k, part in enumerate(LONGEST) if f"tests/{part}" in path), len(LONGEST))

    items.sort(key=place)


@pytest.fixture
def of_the_command() -> Iterator[None]:
    """Messages are those of the command, not of Python."""
    with command_messages():
        yield


@pytest.fixture(scope="session")
def arm() -> Arm:
    """The KUKA LWR IV, seven joints."""
    return load_robot("kuka_lwr4")


@pytest.fixture(scope="session")
def planar() -> Arm:
    """The planar arm of two links."""
    return load_robot("planar2")


@pytest.fixture(autouse=True)
def log_handlers() -> Iterator[None]:
    """What a command adds to the log within a test goes with the test."""
    before, level = logging.root.handlers[:], logging.root.level
    yield
    for handler in [handler for handler in logging.root.handlers if handler not in before]:
        logging.root.removeHandler(handler)
    logging.root.setLevel(level)


@pytest.fixture(scope="session")
def outputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of tiny artifacts that all tests of a run share, whichever process they are in."""
    own = tmp_path_factory.getbasetemp()
    return (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "outputs"
