import json
import logging
import os
import re
import signal
import subprocess
import sys
import time
import types

import pandas as pd
import pytest

from sidegan.base import parallel
from sidegan.errors import ArtifactError, ConfigError, InfeasibleError, StorageError
from sidegan.pipeline import callbacks, run
from sidegan.pipeline.callbacks import aggregate, job_codes
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.run import main, run_name
from sidegan.pipeline.stage import Stage


def seeds_of(task):
    """A small artifact in the place of the seed set."""
    settings = {"count": task.cfg.seeds.count}
    return Artifact("seeds", task.cfg.robot.name, "seeds", settings, {}, task.cfg.seed, write_seeds, print)


def write_seeds(build):
    (build.folder / "seeds.txt").write_text("seeds")


def make_seeds(task, tracker):
    folder = task.store.produce(seeds_of(task))
    (task.store.run_folder / "table.txt").write_text(folder.name)
    tracker.log_history({"fitness": [3.0, 2.0]})


def use_seeds(task, tracker):
    task.store.require(seeds_of(task))


def fail_on_odd_seeds(task, tracker):
    if task.cfg.seed % 2:
        raise InfeasibleError(f"no start became valid with seed {task.cfg.seed}")


def interrupt(task, tracker):
    raise KeyboardInterrupt


def terminate(task, tracker):
    os.kill(os.getpid(), signal.SIGTERM)


def lose_the_interrupt(task, tracker):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)
    except KeyboardInterrupt:  # as a compiler does whose callbacks cannot raise
        raise RuntimeError("no compiled object yet") from None


def break_down(task, tracker):
    raise ZeroDivisionError("a bug")


def fill_disk(task, tracker):
    raise OSError(28, "No space left on device", "table.csv")


SHOWN = {
    "seeds": make_seeds,
    "use": use_seeds,
    "odd": fail_on_odd_seeds,
    "interrupt": interrupt,
    "terminate": terminate,
    "lost": lose_the_interrupt,
    "break": break_down,
    "fill": fill_disk,
}


@pytest.fixture
def command(tmp_path, monkeypatch):
    """The command in this process, with small stages and no MLflow: arguments → exit code."""
    monkeypatch.setattr(run, "STAGES", SHOWN)
    monkeypatch.setattr("sidegan.pipeline.stages.stage", lambda name: Stage(show=SHOWN[name]))
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    monkeypatch.chdir(tmp_path)
    handlers, level = logging.root.handlers[:], logging.root.level
    handling = {one: signal.getsignal(one) for one in (signal.SIGTERM, signal.SIGINT)}

    def call(*arguments, tracking="off"):
        chosen = [] if any("experiment=" in one for one in arguments) else ["+experiment=exp1"]
        flags = [one for one in arguments if one.startswith("-")]
        settings = [one for one in arguments if not one.startswith("-")]
        monkeypatch.setattr(sys, "argv", ["sidegan", *flags, *chosen, *settings, f"tracking={tracking}"])
        try:
            return main()
        except SystemExit as leave:
            return leave.code

    yield call
    logging.root.handlers[:] = handlers
    logging.root.setLevel(level)
    for one, handler in handling.items():
        signal.signal(one, handler)


def statuses(folder):
    return [json.loads(path.read_text()) for path in sorted(folder.rglob("status.json"))]


def test_stages_run_in_order_and_a_second_run_reuses_the_artifact(command, tmp_path, capsys):
    assert command("stages=[seeds,use]") == 0
    first = capsys.readouterr().err
    assert first.index("seeds: made") < first.index("seeds: done in") < first.index("use: done in")
    assert command("stages=[seeds,use]") == 0
    assert "seeds: reused from outputs/seeds/kuka_lwr4-" in capsys.readouterr().err
    runs = sorted((tmp_path / "outputs" / "runs" / "exp1").iterdir())
    assert len(runs) == 2
    for folder in runs:
        assert {"run.log", "status.json", "table.txt", ".hydra"} <= {path.name for path in folder.iterdir()}
    assert statuses(tmp_path) == [{"code": 0, "error": None}] * 2
    assert "use: done in" in next(runs[0].glob("*.log")).read_text()


def test_a_stage_that_needs_another_one_says_so(command, capsys):
    assert command("stages=[use]") == 1
    error = capsys.readouterr().err
    assert "error: there is no seeds/kuka_lwr4 for this configuration, run stage seeds first" in error
    assert "Traceback" not in error


def test_whoever_starts_elsewhere_finds_the_results_there(command, tmp_path):
    assert command("stages=[seeds]", f"outputs={tmp_path / 'else' / 'where'}", "named=true") == 0
    assert (tmp_path / "else" / "where" / "seeds" / "kuka_lwr4" / "seeds.txt").exists()
    assert not (tmp_path / "outputs").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["seeds.cuont=3"], "error: seeds.cuont: there is no such setting; did you mean seeds.count?"),
        (["+seeds.cuont=3"], "error: seeds.cuont: there is no such setting; did you mean seeds.count?"),
        (["sedes=paper"], "error: sedes: there is no such setting; did you mean seeds?"),
        (
            ["+experiment=excite", "excite.count=0"],
            "error: excite.count: what this would set is a list, and count names no entry of it",
        ),
        (["seeds.count=many"], "error: seeds.count is 'many', expected a whole number ≥ 1"),
        (["gan=eigne"], "Could not find 'gan/eigne'"),
        (["experiment=exp1"], "use +experiment=exp1"),
        (["recordings=[a.csv]"], "recordings: this is a setting of other experiments"),
        (
            ["robot.limits={joint_1: 1}"],
            "error: robot.limits: joint_1 is no setting of this group, which has position, velocity, accel",
        ),
        (["robot={limits: {velocit: {a: 1}}}"], "did you mean robot.limits.velocity?"),
        (["+experiment=exp99"], "Could not find 'experiment/exp99'"),
        (["seed=0,1"], "To sweep over it, add --multirun"),
        (["seed=="], "Error parsing override 'seed=='"),
        (["stages=[seed]"], "error: stages: there is no stage 'seed', expected some of seeds, use, odd"),
        (["stages=[]"], "error: there is nothing to run: give +experiment=…"),
        (["parallel=dask", "parallel.scheduler=here"], "expected an address like tcp://host:8786"),
        (["parallel.scheduler=tcp://host:8786"], "scheduler is of dask; choose parallel=dask"),
        (["device=cuda:99"], "error: device is 'cuda:99', which is not there"),
    ],
)
def test_a_wrong_command_is_refused_before_any_work(command, capsys, tmp_path, arguments, expected):
    assert command("stages=[seeds]", *arguments) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "Traceback" not in error
    assert not (tmp_path / "outputs" / "seeds").exists()


def test_private_files_of_a_group_are_not_offered(command, capsys):
    command("gan=eigne")
    error = capsys.readouterr().err
    assert "diagonal" in error and "_base" not in error


def test_what_a_stage_refuses_is_one_line_and_leaves_its_mark(command, capsys, tmp_path):
    assert command("stages=[odd]", "seed=1") == 1
    error = [line for line in capsys.readouterr().err.splitlines() if "error:" in line]
    assert len(error) == 1 and "no start became valid with seed 1" in error[0]
    assert statuses(tmp_path) == [{"code": 1, "error": "InfeasibleError: no start became valid with seed 1"}]


def test_a_bug_comes_with_its_traceback(command, capsys):
    assert command("stages=[break]") == 1
    error = capsys.readouterr().err
    assert "error: unexpected ZeroDivisionError" in error and "Traceback" in error


def test_a_full_disk_is_one_line(command, capsys):
    assert command("stages=[fill]") == 1
    error = capsys.readouterr().err
    assert "No space left on device" in error and "Traceback" not in error


@pytest.mark.parametrize("multirun", [[], ["-m"]])
def test_outputs_that_cannot_be_written_are_one_line(command, capsys, tmp_path, multirun):
    (tmp_path / "file").write_text("")
    assert command(*multirun, "stages=[seeds]", "outputs=file") == 1
    error = capsys.readouterr().err
    assert "error: the outputs cannot be written" in error and "Traceback" not in error


@pytest.mark.parametrize("stage", ["interrupt", "terminate", "lost"])
@pytest.mark.parametrize("multirun", [[], ["-m"]])
def test_an_interrupt_says_how_to_go_on(command, capsys, tmp_path, stage, multirun):
    assert command(*multirun, f"stages=[{stage}]") == 130
    assert "the same command again goes on where it was" in capsys.readouterr().err
    assert statuses(tmp_path) == [{"code": 130, "error": "interrupted"}]


def test_a_sweep_runs_every_job_although_one_fails(command, capsys, tmp_path):
    assert command("-m", "stages=[seeds,odd]", "seed=0,1,2", "gan=vanilla,eigen") == 1
    sweep = next((tmp_path / "outputs" / "runs" / "exp1").glob("sweep_*"))
    codes = {folder.name: code for folder, code in job_codes(sweep).items()}
    assert codes == {
        "0_gan=vanilla,seed=0": 0,
        "1_gan=eigen,seed=0": 0,
        "2_gan=vanilla,seed=1": 1,
        "3_gan=eigen,seed=1": 1,
        "4_gan=vanilla,seed=2": 0,
        "5_gan=eigen,seed=2": 0,
    }
    error = capsys.readouterr().err
    assert "error: job 2_gan=vanilla,seed=1 failed" in error and "Traceback" not in error
    assert len(list((tmp_path / "outputs" / "seeds").iterdir())) == 3, (
        "one seed set for each seed, none twice"
    )


def test_a_sweep_in_which_all_goes_well_leaves_with_zero(command):
    assert command("-m", "stages=[odd]", "seed=0,2") == 0


def test_a_job_that_was_killed_before_it_could_tell_counts_as_failed(tmp_path):
    for name in ("0_a", "10_c", "2_b", ".hydra", "plots"):
        (tmp_path / name).mkdir()
    (tmp_path / "0_a" / "status.json").write_text('{"code": 0}')
    (tmp_path / "2_b" / "status.json").write_text('{"co')
    assert {folder.name: code for folder, code in job_codes(tmp_path).items()} == {
        "0_a": 0,
        "2_b": 1,
        "10_c": 1,
    }


@pytest.fixture
def experiment(monkeypatch):
    """A module ``experiments.trial`` that notes what it was given."""
    module = types.ModuleType("experiments.trial")

    def gather(folders, sweep):
        module.seen = [folder.name for folder in folders]
        return pd.DataFrame({"folder": module.seen})

    module.aggregate = gather
    monkeypatch.setitem(sys.modules, "experiments.trial", module)
    return module


def test_the_experiment_gathers_the_jobs_that_finished(experiment, tmp_path):
    table = aggregate("trial", [tmp_path / "0_a"], tmp_path)
    assert list(table.folder) == ["0_a"]
    assert aggregate("trial", [], tmp_path) is None
    assert aggregate("no_such_experiment", [tmp_path], tmp_path) is None
    del experiment.aggregate
    assert aggregate("trial", [tmp_path], tmp_path) is None


def test_a_table_that_cannot_be_made_fails_the_sweep_but_not_silently(command, capsys, monkeypatch):
    def broken(experiment, folders, sweep):
        raise ArtifactError("there is no table in job 0")

    monkeypatch.setattr(callbacks, "aggregate", broken)
    assert command("-m", "stages=[odd]", "seed=0,2") == 1
    assert "there is no table in job 0" in capsys.readouterr().err


def test_mlflow_shows_a_parent_with_its_children(command, tmp_path, monkeypatch):
    table = pd.DataFrame({"nmse": [0.1]})
    monkeypatch.setattr(callbacks, "aggregate", lambda experiment, folders, sweep: table)
    assert command("-m", "stages=[seeds,odd]", "seed=0,1", "gan=eigen", tracking="local") == 1
    from mlflow import MlflowClient

    client = MlflowClient(f"sqlite:///{tmp_path / 'outputs' / 'mlflow.db'}")
    number = client.get_experiment_by_name("exp1").experiment_id
    runs = {run.info.run_name: run for run in client.search_runs([number])}
    parent = runs.pop("exp1 sweep stages=[seeds,odd] seed=0,1 gan=eigen tracking=local")
    assert parent.info.status == "FAILED"
    assert [file.path for file in client.list_artifacts(parent.info.run_id)] == ["sweep.json"]
    assert {name: run.info.status for name, run in runs.items()} == {
        "seeds,odd eigen seed=0": "FINISHED",
        "seeds,odd eigen seed=1": "FAILED",
    }
    for child in runs.values():
        assert child.data.tags["mlflow.parentRunId"] == parent.info.run_id
        assert child.data.metrics["fitness"] == 2.0
        assert child.data.params["gan.eigen.features"] == "spectrum"
    assert callbacks.PARENT not in os.environ


def test_threads_are_set_before_numpy_is_imported(command, monkeypatch):
    for library in ("OMP", "OPENBLAS", "MKL"):
        monkeypatch.setenv(f"{library}_NUM_THREADS", "7")
    assert command("stages=[odd]", "parallel.threads=1") == 0
    assert os.environ["OMP_NUM_THREADS"] == os.environ["OPENBLAS_NUM_THREADS"] == "1"


@pytest.mark.parametrize(("name", "kind"), [("loky", "Loky"), ("dask", "Dask")])
def test_stages_run_on_the_configured_engine(command, monkeypatch, name, kind):
    seen = []
    monkeypatch.setitem(SHOWN, "engine", lambda *_: seen.append(type(parallel._engine).__name__))
    assert command("stages=[engine]", f"parallel={name}") == 0
    assert seen == [kind]


def test_an_engine_that_is_not_installed_is_told_before_any_work(command, monkeypatch, capsys):
    monkeypatch.setattr(run, "find_spec", lambda name: None)
    assert command("stages=[seeds]", "parallel=dask") == 2
    assert "parallel=dask needs Dask: pip install 'sidegan[dask]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        ([], "exp1 seed=3"),
        (["+experiment=exp1", "gan=eigen", "seed=3", "outputs=/x"], "eigen seed=3"),
        (["scale=paper", "parallel.workers=1", "seeds.count=10"], "paper seeds.count=10 seed=3"),
        (["scale=paper", "named=true", "stages=[gan,library]"], "gan,library paper seed=3"),
    ],
)
def test_runs_have_names_for_people(overrides, name):
    assert run_name("exp1", overrides, {"gan": "eigen", "scale": "paper"}, 3) == name


@pytest.mark.parametrize(
    ("error", "code"),
    [(ConfigError, 2), (StorageError, 1), (PermissionError(13, "denied", "x"), 1), (OSError, 1)],
)
def test_every_error_has_its_exit_code(command, monkeypatch, error, code):
    def stage(task, tracker):
        raise error

    monkeypatch.setitem(SHOWN, "error", stage)
    assert command("stages=[error]") == code


def test_a_status_that_cannot_be_written_hides_nothing(command, monkeypatch, capsys):
    def full(path, content):
        raise StorageError("no space left")

    monkeypatch.setattr(run, "write_json", full)
    assert command("stages=[odd]", "seed=1") == 1
    assert "no start became valid" in capsys.readouterr().err


def python(*arguments, cwd):
    return subprocess.run(
        [sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, timeout=6000, check=False
    )


def test_help_fits_a_screen_and_starts_nothing(tmp_path):
    done = python("-m", "sidegan.run", "--help", cwd=tmp_path)
    assert done.returncode == 0
    for words in (
        "sidegan +experiment=exp1 ",
        "scale=paper",
        "-m +experiment=exp1 gan=vanilla,eigen,diagonal seed=0,1,2",
        "'stages=[seeds]'",
        "robot.name=/path/to/arm.urdf",
        "outputs/mlflow.db",
        "+experiment=excite",
        "--help-all",
    ):
        assert words in done.stdout
    lines = done.stdout.strip().splitlines()
    assert len(lines) <= 40 and max(map(len, lines)) <= 110
    assert list(tmp_path.iterdir()) == []


def test_all_of_the_help_has_every_stage_group_and_setting(tmp_path):
    done = python("-m", "sidegan.run", "--help-all", cwd=tmp_path)
    assert done.returncode == 0
    for words in (
        "sidegan +experiment=exp1 ",
        "  long            the single long trajectory in each of its readings",
        "experiment: beyond, compare, design, excite, exp1",
        "workspace: desk, free",
    ):
        assert words in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_settings_of_ones_own_lie_in_a_folder_of_ones_own(tmp_path):
    (tmp_path / "lab" / "robot").mkdir(parents=True)
    (tmp_path / "lab" / "robot" / "ours.yaml").write_text("defaults: [planar2]\n", encoding="utf-8")
    options = "--config-dir", "lab", "--cfg", "job", "--package", "robot"
    done = python("-m", "sidegan.run", *options, "+experiment=exp1", "robot=ours", cwd=tmp_path)
    assert done.returncode == 0 and "name: planar2" in done.stdout, done.stderr


def test_the_configuration_is_shown_without_a_heavy_import(tmp_path):
    done = python("-X", "importtime", "-m", "sidegan.run", "--cfg", "job", "+experiment=exp1", cwd=tmp_path)
    assert done.returncode == 0
    assert "experiment: exp1" in done.stdout
    imported = set(re.findall(r"\|\s+(\w+)$", done.stderr, re.MULTILINE))
    assert "omegaconf" in imported
    assert not imported & {
        "torch",
        "numpy",
        "pandas",
        "mlflow",
        "pytorch_lightning",
        "pinocchio",
        "pygmo",
        "matplotlib",
        "joblib",
        "distributed",
    }


def test_a_typo_ends_the_command_with_its_code(tmp_path):
    done = python("-m", "sidegan.run", "+experiment=exp1", "seeds.cuont=3", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "error: seeds.cuont: there is no such setting; did you mean seeds.count?\n"
    assert list(tmp_path.iterdir()) == []
