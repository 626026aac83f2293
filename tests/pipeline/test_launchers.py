"""Sweeps on other launchers than Hydra's own, as far as one machine allows."""

import json
import subprocess
import sys

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException

from sidegan.pipeline import callbacks  # noqa: F401 - registers what the paths in conf/ use
from sidegan.pipeline.run import CONF, explain
from tests.tiny import TINY

PLUGINS = {
    "processes": "hydra_plugins.hydra_joblib_launcher",
    "slurm": "hydra_plugins.hydra_submitit_launcher",
    "slurm_here": "hydra_plugins.hydra_submitit_launcher",
}
EXTRAS = {"processes": "sweep", "slurm": "slurm", "slurm_here": "slurm"}


def composed(launcher, *overrides):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        overrides = [f"hydra/launcher={launcher}", *overrides]
        return compose("config", overrides, return_hydra_config=True).hydra.launcher


@pytest.mark.parametrize(("name", "plugin"), PLUGINS.items())
def test_a_launcher_is_the_plugins_with_our_settings(name, plugin):
    pytest.importorskip(plugin)
    launcher = composed(name, "hydra.launcher.n_jobs=3" if name == "processes" else "hydra.launcher.mem_gb=3")
    assert launcher._target_.startswith(plugin)
    assert launcher.get("n_jobs", launcher.get("mem_gb")) == 3
    if name == "slurm":
        assert launcher.max_num_timeout > 0, "a job that ran out of time goes on where it was"


@pytest.mark.parametrize("name", PLUGINS)
def test_a_launcher_whose_plugin_is_missing_is_told(name, monkeypatch):
    initialised = composed("basic")
    assert "BasicLauncher" in initialised._target_
    store = ConfigStore.instance().repo["hydra"]["launcher"]
    for known in [key for key in store if key.startswith(("joblib", "submitit"))]:
        monkeypatch.delitem(store, known)
    with pytest.raises(HydraException) as error:
        composed(name)
    assert explain(error.value) == (f"this launcher needs a plugin: pip install 'sidegan[{EXTRAS[name]}]'")


def sweep(tmp_path, launcher):
    """A sweep over two jobs, one of which is refused; its exit code, output and statuses by job."""
    arguments = ["+experiment=exp1", *TINY, "stages=[seeds]", "seeds.count=4", "trajectory.home=[0,0],[4,0]"]
    arguments += [f"outputs={tmp_path / 'outputs'}", f"hydra/launcher={launcher}"]
    done = subprocess.run(
        [sys.executable, "-m", "sidegan.run", "-m", *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=6000,
        check=False,
    )
    (folder,) = (tmp_path / "outputs" / "runs" / "exp1").glob("sweep_*")
    found = {job.name[0]: json.loads((job / "status.json").read_text()) for job in folder.glob("[0-9]*")}
    return done.returncode, done.stderr, [found[key]["code"] for key in sorted(found)]


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["processes", "slurm_here"])
def test_a_sweep_runs_elsewhere_and_leaves_with_the_worst_code(tmp_path, launcher):
    pytest.importorskip(PLUGINS[launcher])
    code, told, codes = sweep(tmp_path, launcher)
    assert codes == [0, 1]
    assert code == 1 and "Traceback" not in told, told
    assert len(list((tmp_path / "outputs" / "seeds").glob("planar2-*"))) == 1


def test_slurm_on_a_machine_without_it_is_one_line(tmp_path, monkeypatch):
    pytest.importorskip(PLUGINS["slurm"])
    monkeypatch.setenv("PATH", str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-m", "sidegan.run", "-m", "hydra/launcher=slurm", "tracking=off", "seed=0,1"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 1
    assert "hydra/launcher=slurm is for a machine that submits to SLURM" in done.stderr
    assert "Traceback" not in done.stderr
