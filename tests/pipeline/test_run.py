"""The command: its stages in order, its exit codes, sweeps, and what it prints before it imports anything."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from functools import partial

import pytest
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException

from sidegan.errors import ConfigError, InfeasibleError, StorageError
from sidegan.pipeline import run
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.compose import explain
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.sweep import job_codes
from tests.tiny import TINY, composed


def write_seeds(build):
    (build.folder / "seeds.txt").write_text("seeds")


def seeds_of(context):
    """A small artifact in the place of the seed set."""
    named = {"maker": "seeds", "label": context.cfg.robot.name, "title": "seeds", "seed": context.cfg.seed}
    return Artifact(**named, settings={}, inputs={}, make=write_seeds, metrics=print)


def fail_on_odd_seeds(context, tracker):
    if context.cfg.seed % 2:
        raise InfeasibleError(f"no start became valid with seed {context.cfg.seed}")


def lose_the_interrupt(context, tracker):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)
    except KeyboardInterrupt:  # as a compiler does whose callbacks cannot raise
        raise RuntimeError("no compiled object yet") from None


def fails(error):
    """A stage that raises."""

    def show(context, tracker):
        raise error

    return show


FAILURES = {  # by stage: what it raises, the exit code, and a word of what is told
    "config": (ConfigError("mine"), 2, "error: mine"),
    "storage": (StorageError("no room"), 1, "error: no room"),
    "denied": (PermissionError(13, "denied", "x"), 1, "denied"),
    "full": (OSError(28, "No space left on device", "x"), 1, "No space left on device"),
    "bug": (ZeroDivisionError("a bug"), 1, "error: unexpected ZeroDivisionError"),
}
STAGES = {
    "seeds": lambda context, tracker: context.store.produce(seeds_of(context)),
    "use": lambda context, tracker: context.store.require(seeds_of(context)),
    "odd": fail_on_odd_seeds,
    "interrupt": fails(KeyboardInterrupt),
    "terminate": lambda context, tracker: os.kill(os.getpid(), signal.SIGTERM),
    "lost": lose_the_interrupt,
    **{name: fails(error) for name, (error, *_) in FAILURES.items()},
}


@pytest.fixture
def command(command):
    """The command of an experiment with few settings, which are composed faster."""
    return partial(command, "+experiment=gains", "robot=kuka_lwr4")


@pytest.fixture(autouse=True)
def small_stages(monkeypatch):
    """Stages that do one thing each, in place of the real ones."""
    monkeypatch.setattr("sidegan.pipeline.stages.stage", lambda name: Stage(show=STAGES[name]))


def statuses(folder):
    return [json.loads(path.read_text()) for path in sorted(folder.rglob("status.json"))]


def test_stages_run_in_order_and_a_second_run_reuses_the_artifact(command, tmp_path, capsys):
    where = tmp_path / "else" / "where"
    assert command("stages=[seeds,use]", f"outputs={where}") == 0
    first = capsys.readouterr().err
    assert first.index("seeds: made") < first.index("seeds: done in") < first.index("use: done in")
    assert command("stages=[seeds,use]", f"outputs={where}") == 0
    assert "else/where/seeds/kuka_lwr4-" in capsys.readouterr().err.partition("seeds: reused from")[2]
    assert [path.name for path in tmp_path.iterdir()] == ["else"]
    logs = [path.read_text() for path in where.glob("runs/gains/*/run.log")]
    assert len(logs) == 2 and all("use: done in" in text for text in logs)
    assert statuses(tmp_path) == [{"code": 0, "error": None}] * 2


@pytest.mark.parametrize("stage", FAILURES)
def test_a_refusal_is_one_line_and_a_bug_has_its_traceback(command, capsys, tmp_path, stage):
    error, code, words = FAILURES[stage]
    assert command(f"stages=[{stage}]") == code
    shown = capsys.readouterr().err
    (line,) = [line for line in shown.splitlines() if "error:" in line]
    assert words in line and ("Traceback" in shown) == (stage == "bug")
    assert statuses(tmp_path) == [{"code": code, "error": f"{type(error).__name__}: {error}"}]


def test_a_fault_beyond_a_stage_is_no_wrong_configuration(command, monkeypatch):
    def fault(*arguments):
        raise ValueError("a fault of ours")

    monkeypatch.setattr("sidegan.run.run_job", fault)
    with pytest.raises(ValueError, match="a fault of ours"):
        command("stages=[use]")


def test_a_status_write_failure_does_not_hide_the_error(command, monkeypatch, capsys):
    def full(path, content):
        raise StorageError("no space left")

    monkeypatch.setattr(run, "write_json", full)
    assert command("stages=[odd]", "seed=1") == 1
    assert "no start became valid" in capsys.readouterr().err


@pytest.mark.parametrize("multirun", [[], ["-m"]])
def test_unwritable_outputs_are_reported_in_one_line(command, capsys, tmp_path, multirun):
    (tmp_path / "file").write_text("")
    assert command(*multirun, "stages=[seeds]", "outputs=file") == 1
    error = capsys.readouterr().err
    assert "error: the outputs cannot be written" in error and "Traceback" not in error


@pytest.mark.parametrize(
    "words", ["stages=[interrupt]", "stages=[terminate]", "stages=[lost]", "-m stages=[terminate]"]
)
def test_an_interrupt_says_how_to_continue(command, capsys, tmp_path, words):
    assert command(*words.split()) == 130
    assert "the same command continues where it stopped" in capsys.readouterr().err
    assert statuses(tmp_path) == [{"code": 130, "error": "interrupted"}]


def test_a_sweep_continues_after_a_failed_job(command, capsys, tmp_path):
    assert command("-m", "stages=[seeds,odd]", "seed=0,1", "load.mass=1,2") == 1
    sweep = next((tmp_path / "outputs" / "runs" / "gains").glob("sweep_*"))
    names = [f"{k}_load.mass={k % 2 + 1},robot=kuka_lwr4,seed={k // 2}" for k in range(4)]
    codes = {folder.name: code for folder, code in job_codes(sweep).items()}
    assert codes == dict(zip(names, (0, 0, 1, 1)))
    error = capsys.readouterr().err
    assert "error: job 2_load.mass=1,robot=kuka_lwr4,seed=1 failed" in error and "Traceback" not in error
    assert len(list((tmp_path / "outputs" / "seeds").iterdir())) == 2, "one for each seed, none twice"


def test_a_job_without_a_status_counts_as_failed(tmp_path):
    for name in ("0_a", "10_c", "2_b", ".hydra", "plots"):
        (tmp_path / name).mkdir()
    (tmp_path / "0_a" / "status.json").write_text('{"code": 0}')
    (tmp_path / "2_b" / "status.json").write_text('{"co')
    codes = {folder.name: code for folder, code in job_codes(tmp_path).items()}
    assert codes == {"0_a": 0, "2_b": 1, "10_c": 1}


def test_a_failed_sweep_table_is_reported(command, capsys, monkeypatch):
    def table(folders):
        raise StorageError("there is no table in job 0")

    monkeypatch.setattr("sidegan.pipeline.sweep.sweep_table", table)
    assert command("-m", "stages=[odd]", "seed=2") == 1
    assert "there is no table in job 0" in capsys.readouterr().err


def test_help_fits_a_screen_and_starts_nothing(command, capsys, tmp_path):
    assert command("--help") == 0
    shown = capsys.readouterr().out
    examples = (
        "+experiment=exp1 ",
        "seed=0,1,2",
        "'stages=[seeds]'",
        "robot.name=arm.urdf",
        "workspace: desk, free",
    )
    assert all(words in shown for words in examples)
    lines = [line for line in shown.splitlines() if line.startswith((" ", "="))]  # without Hydra's choices
    assert len(lines) <= 50 and max(map(len, lines)) <= 110
    assert [path for path in tmp_path.iterdir() if path.suffix != ".log"] == []


def test_help_may_be_cut_short(tmp_path):
    """As by `--help | head`: whoever reads it has seen enough."""
    command = [sys.executable, "-m", "sidegan.run", "--help"]
    pipe, end = os.pipe()
    os.close(pipe)
    done = subprocess.run(command, cwd=tmp_path, stdout=end, stderr=subprocess.PIPE, text=True, check=False)
    os.close(end)
    assert done.stderr == ""


HEAVY = {"torch", "numpy", "pandas", "mlflow", "pytorch_lightning", "pinocchio", "pygmo", "matplotlib"}


def test_help_is_shown_without_a_heavy_import(tmp_path):
    command = [sys.executable, "-X", "importtime", "-m", "sidegan.run", "--help"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=6000, check=False)
    assert done.returncode == 0 and "experiment: ablation" in done.stdout
    imported = set(re.findall(r"\|\s+(\w+)$", done.stderr, re.MULTILINE))
    assert "omegaconf" in imported and not imported & HEAVY
    assert list(tmp_path.iterdir()) == []


JOBLIB, SUBMITIT = "hydra_plugins.hydra_joblib_launcher", "hydra_plugins.hydra_submitit_launcher"
PLUGINS = {"processes": (JOBLIB, "sweep"), "slurm": (SUBMITIT, "slurm")}


@pytest.mark.parametrize("name", PLUGINS)
def test_a_missing_launcher_plugin_is_reported(name, monkeypatch):
    composed("hydra/launcher=basic")  # registers the plugins
    store = ConfigStore.instance().repo["hydra"]["launcher"]
    for known in [key for key in store if key.startswith(("joblib", "submitit"))]:
        monkeypatch.delitem(store, known)
    with pytest.raises(HydraException) as error:
        composed(f"hydra/launcher={name}")
    assert explain(error.value) == f"this launcher needs a plugin: pip install 'sidegan[{PLUGINS[name][1]}]'"


def sweep(folder, *words):
    command = [sys.executable, "-m", "sidegan.run", "-m", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=6000, check=False)


def test_missing_slurm_is_reported_in_one_line(tmp_path, monkeypatch):
    pytest.importorskip(SUBMITIT)
    monkeypatch.setenv("PATH", str(tmp_path))
    done = sweep(tmp_path, "hydra/launcher=slurm", "tracking=off", "seed=0,1")
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "hydra/launcher=slurm is for a machine that submits to SLURM" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["processes", "submitit_local"])
def test_a_sweep_on_another_launcher_returns_the_worst_exit_code(tmp_path, launcher):
    pytest.importorskip(PLUGINS.get(launcher, PLUGINS["slurm"])[0])
    words = "+experiment=exp1", *TINY, "stages=[seeds]", "seeds.count=4", "trajectory.home=[0,0],[4,0]"
    done = sweep(tmp_path, *words, f"hydra/launcher={launcher}")
    assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
    jobs = sorted((tmp_path / "outputs" / "runs" / "exp1").glob("sweep_*/[0-9]*/status.json"))
    assert [json.loads(job.read_text())["code"] for job in jobs] == [0, 1]
    assert len(list((tmp_path / "outputs" / "seeds").glob("planar2-*"))) == 1
