"""Sweeps on other launchers than Hydra's own, as far as one machine allows."""

import json
import subprocess
import sys

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException

from sidegan.pipeline.compose import explain
from sidegan.pipeline.places import CONF
from tests.tiny import TINY

JOBLIB, SUBMITIT = "hydra_plugins.hydra_joblib_launcher", "hydra_plugins.hydra_submitit_launcher"
PLUGINS = {"processes": (JOBLIB, "sweep"), "slurm": (SUBMITIT, "slurm")}


def composed(launcher):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("config", [f"hydra/launcher={launcher}"])


@pytest.mark.parametrize("name", PLUGINS)
def test_a_missing_launcher_plugin_is_reported(name, monkeypatch):
    composed("basic")  # registers the plugins
    store = ConfigStore.instance().repo["hydra"]["launcher"]
    for known in [key for key in store if key.startswith(("joblib", "submitit"))]:
        monkeypatch.delitem(store, known)
    with pytest.raises(HydraException) as error:
        composed(name)
    assert explain(error.value) == f"this launcher needs a plugin: pip install 'sidegan[{PLUGINS[name][1]}]'"


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["processes", "submitit_local"])
def test_a_sweep_on_another_launcher_returns_the_worst_exit_code(tmp_path, launcher):
    pytest.importorskip(PLUGINS.get(launcher, PLUGINS["slurm"])[0])
    words = "+experiment=exp1", *TINY, "stages=[seeds]", "seeds.count=4", "trajectory.home=[0,0],[4,0]"
    command = [sys.executable, "-m", "sidegan.run", "-m", *words, f"hydra/launcher={launcher}"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=6000, check=False)
    assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
    jobs = sorted((tmp_path / "outputs" / "runs" / "exp1").glob("sweep_*/[0-9]*/status.json"))
    assert [json.loads(job.read_text())["code"] for job in jobs] == [0, 1]
    assert len(list((tmp_path / "outputs" / "seeds").glob("planar2-*"))) == 1
