"""The way from recordings to a model, through the command's own stage."""

import json
import shlex

import mujoco
import numpy as np
import pandas as pd
import pinocchio as pin
import pytest

from sidegan.cell import Cell
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.compose import composed
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import identify
from sidegan.pipeline.store import PARAMS
from sidegan.recording.settings import Files
from sidegan.steps.identify import check_recordings
from tests.oracle import mujoco_torque, pinocchio_torque, python_class
from tests.pipeline.conftest import client_of
from tests.recording.files import write_moved
from tests.tiny import tiny

FILES = "MLmodel arm.h check.json links.csv model.py parameters.csv parameters.json report.html verdict.json"


def identified(outputs, *overrides, run="run"):
    """Verdict and folder of one run."""
    folder = outputs / "runs" / run
    run_stages(tiny(f"outputs={outputs}", *overrides, experiment="identify"), folder, run)
    return json.loads((folder / "verdict.json").read_text()), folder


@pytest.fixture(scope="module")
def files(tmp_path_factory, planar):
    folder = tmp_path_factory.mktemp("recordings")
    return [write_moved(folder / f"{name}.csv", planar, seed) for seed, name in enumerate("abc")]


def given(*files):
    """Overrides for the last of some files to be held out."""
    *training, validation = files
    return f"recordings=[{','.join(map(str, training))}]", f"validation=[{validation}]"


@pytest.fixture(scope="module")
def once(tmp_path_factory, files):
    return identified(tmp_path_factory.mktemp("outputs"), *given(*files))


def test_all_results_are_in_the_run_folder(once):
    verdict, folder = once
    left = {path.name for path in folder.iterdir()}
    assert left >= {*FILES.split(), "planar2.urdf", "planar2.xml"}
    assert PARAMS not in left  # which tells of the artifact, not of the run
    assert verdict["reasons"] and verdict["condition_number"] > 1
    assert len(verdict["validation"]["nmse"]) == len(verdict["joints"]) == 2
    checked = json.loads((folder / "check.json").read_text())
    assert [recording["name"] for recording in checked] == ["a.csv", "b.csv", "c.csv"]
    assert not [path for path in folder.parents[1].rglob("*") if path.suffix in (".tmp", ".work")]
    assert "c.csv" in (folder / "report.html").read_text()


@pytest.fixture(scope="module")
def consistent(once, planar):
    """The model's numbers, and the consistent one's torques [N·m] at states that move, (50, 2) each."""
    model = json.loads((once[1] / "parameters.json").read_text())
    numbers = model["consistent"]
    terms = {name: np.array(x, float) for name, x in numbers["terms"].items()}
    generator = np.random.default_rng(0)
    q, dq, ddq = generator.standard_normal((3, 50, 2))
    q = np.clip(q, -2, 2)  # within the limits, which MuJoCo enforces
    dq = dq + 0.6 * np.sign(dq)  # where a smooth sign is one
    links = np.array(numbers["inertial_parameters"], float)
    torque = RigidBody(planar).regressor(q, dq, ddq) @ links.ravel() + terms["offset"]
    torque += terms["viscous"] * dq + terms["coulomb"] * np.tanh(dq / model["sign_width"])
    return model, torque, [q, dq, ddq]


def by_mujoco(folder, *states):
    """MuJoCo's torques of the MJCF with its damping and friction, and these."""
    mjcf = mujoco.MjModel.from_xml_path(str(folder / "planar2.xml"))
    return mujoco_torque(mjcf, *states), mjcf.dof_damping, mjcf.dof_frictionloss


def by_pinocchio(folder, q, dq, ddq):
    """Pinocchio's torques of the URDF, its damping and friction added, and these."""
    urdf = pin.buildModelFromUrdf(str(folder / "planar2.urdf"))
    viscous, coulomb = urdf.damping, urdf.upperDryFrictionLimit
    torque = pinocchio_torque(urdf, q, dq, ddq) + viscous * dq + coulomb * np.sign(dq)
    return torque, viscous, coulomb


@pytest.mark.parametrize(("read", "apart"), [(by_pinocchio, 1e-9), (by_mujoco, 1e-6)])
def test_exported_models_give_the_consistent_links_torques_with_their_own_friction(
    once, consistent, read, apart
):
    model, torque, states = consistent
    (found, viscous, coulomb), terms = read(once[1], *states), model["consistent"]["terms"]
    change = (viscous - terms["viscous"]) * states[1] + (coulomb - terms["coulomb"]) * np.sign(states[1])
    np.testing.assert_allclose(found, torque + change - terms["offset"], rtol=0, atol=apart)  # N·m


def test_each_file_is_read_again_and_predicts_as_well_as_what_it_holds(once):
    verdict, _ = once
    model, files = verdict["validation"]["nmse"], verdict["files"]
    assert [*files] == ["planar2.urdf", "planar2.xml", "model.py"]
    for errors in files.values():
        assert errors["nmse_mean"] == pytest.approx(np.mean(errors["nmse"]))
        np.testing.assert_allclose(errors["nmse"], model, rtol=0.2, atol=1e-4)


def test_the_python_class_splits_its_torque(once, consistent):
    verdict, folder = once
    model = python_class(folder)
    assert model.joints == ["shoulder", "elbow"]
    assert model.method == verdict["use"] == "consistent" and "Use the consistent" in verdict["advice"]
    assert verdict["validation"]["nmse"] == verdict["validation"]["consistent"]["nmse"]
    _, torque, states = consistent
    batch = [x.reshape(2, -1, 2) for x in states]
    np.testing.assert_allclose(model.torque(*batch), torque.reshape(batch[0].shape), rtol=0, atol=1e-9)
    q, dq, ddq = (x[0] for x in states)
    accelerating = model.torque(q, dq, ddq) - model.torque(q, dq, 0 * ddq)
    np.testing.assert_allclose(model.mass_matrix(q) @ ddq, accelerating, rtol=0, atol=1e-9)
    resting = model.gravity(q) + model.friction(q, 0 * dq, model.gravity(q))
    np.testing.assert_allclose(model.torque(q, 0 * dq, 0 * ddq), resting, rtol=0, atol=1e-9)


def test_a_repeated_run_is_reused_and_loads_in_mlflow(once, files, consistent, root, monkeypatch):
    import mlflow

    first, (_, torque, states) = once[1], consistent
    outputs, uri = first.parents[1], f"sqlite:///{root / 'mlflow.db'}"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    made = {path: path.stat().st_mtime_ns for path in outputs.glob("identify/*/params.json")}
    _, again = identified(outputs, *given(*files), f"tracking={uri}", run="again")
    assert {path: path.stat().st_mtime_ns for path in outputs.glob("identify/*/params.json")} == made
    assert (again / "report.html").read_bytes() == (first / "report.html").read_bytes()
    client = client_of(root)
    (run,) = client.search_runs([client.get_experiment_by_name("identify").experiment_id])
    names = [f"{letter}_{joint}" for letter in ("q", "dq", "ddq") for joint in ("shoulder", "elbow")]
    table = pd.DataFrame(np.hstack(states), range(100, 150), names)[names[::-1]]
    for address in (str(first), f"runs:/{run.info.run_id}/identify"):
        model = mlflow.pyfunc.load_model(address)
        found = model.predict(table)
        assert [*found.columns] == ["tau_shoulder", "tau_elbow"] and found.index.equals(table.index)
        np.testing.assert_allclose(found.to_numpy(), torque, rtol=0, atol=1e-9)
        with pytest.raises(KeyError, match="q_elbow"):
            model.predict(table.drop(columns="q_elbow"))


def test_a_changed_recording_gives_another_model(context, files, tmp_path):
    copy = tmp_path / files[2].name
    copy.write_text("".join(files[2].read_text().splitlines(keepends=True)[:-1]))
    first, other = (
        identify.model(context(*given(*files[:2], last), experiment="identify")) for last in (files[2], copy)
    )
    assert first.digest != other.digest


NASTY = """it's 50% (of) a, b [1] = {x} ${y} "ä" """.strip()


def test_the_command_that_reproduces_a_model_reads_the_same_files(tmp_path, planar):
    """Whatever the paths, by the shell's words and Hydra's grammar; and numbers to the last digit."""
    folder = tmp_path / NASTY
    folder.mkdir()
    urdf = folder / "arm, 2.urdf"
    urdf.write_text(planar.urdf.read_text())
    names = "a, b.csv", "c.csv", "d.csv"
    paths = [str(write_moved(folder / name, planar, seed)) for seed, name in enumerate(names)]
    files = {"position": paths[1], "velocity": paths[1], "torque": paths[1]}
    cell = Cell(urdf, limits={"velocity": 10 / 3}, locked=None)
    for validation in ([paths[2]], 0.1 + 0.2):
        gains = np.array([2.0, 1 / 3])
        origin = check_recordings(cell, [paths[0], files], validation, gains=gains).origin
        python, run, module, *words = shlex.split(origin.command)
        read = composed(*words)
        assert [python, run, module] == ["python", "-m", "sidegan.run"]
        assert read.recordings == [paths[0], Files(**files)] and read.validation == validation
        assert (read.robot.name, read.robot.setup) == (str(urdf), cell.setup)
        assert read.robot.gains == gains.tolist()
    read = composed(*shlex.split(origin.excite)[3:])
    assert (read.robot.name, read.robot.setup) == (str(urdf), cell.setup)


def test_a_held_out_end_and_a_hostile_robot_name(files, tmp_path, planar):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(planar.urdf.read_text().replace('name="planar2"', 'name="../../../evil"'))
    words = f"robot.name={urdf}", f"recordings=[{files[0]}]", "validation=0.3", "recording.units.torque=mNm"
    verdict, folder = identified(tmp_path / "deep" / "outputs", *words)
    assert verdict["validation"]["kind"] == "held out" and verdict["validation"]["nmse_mean"] < 5e-3
    assert verdict["validation"]["recordings"] == ["a.csv, last 30%"]
    assert "validation=0.3" in (folder / "report.html").read_text() and (folder / "evil.urdf").is_file()
    assert all(folder.parents[1] in path.parents for path in tmp_path.rglob("*evil*"))
