"""The way from recordings to a model, through the command's own stage."""

import importlib.util
import json
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
import torch

from sidegan.errors import ConfigError, InfeasibleError, RecordingError, RobotError
from sidegan.identification import Terms, TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.run import main, run_stages
from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages.identification import identification
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import excitation_sets
from sidegan.pipeline.store import STAMP, Store
from sidegan.pipeline.task import Task
from sidegan.robot import load_robot
from tests.pipeline.conftest import client_of
from tests.recording.conftest import real
from tests.recording.files import frame
from tests.recording.made import moved
from tests.settings import settings
from tests.tiny import composed, tiny

FILES = {
    "MLmodel",
    "check.json",
    "links.csv",
    "model.py",
    "parameters.csv",
    "parameters.json",
    "planar2.urdf",
    "planar2.xml",
    "report.html",
    "verdict.json",
}
VISCOUS, COULOMB = torch.tensor([2.0, 0.8]), torch.tensor([1.0, 0.4])


def configured(outputs, *overrides):
    common = ("+experiment=identify", "tracking=off", f"outputs={outputs}")
    return validate(composed(*common, *overrides))


def identified(outputs, *overrides, run="run"):
    """Verdict and folder of one run."""
    folder = outputs / "runs" / run
    run_stages(configured(outputs, *overrides), folder, run)
    return json.loads((folder / "verdict.json").read_text()), folder


def write(folder, name, planar, seed, seconds=30):
    """A recording of a random motion, with friction and noise."""
    generator = torch.Generator().manual_seed(seed)
    time = np.arange(seconds * 200) / 200
    recording = moved(planar, time, VISCOUS, COULOMB, generator)
    frame(recording).to_csv(folder / name, index=False)
    return folder / name


@pytest.fixture(scope="module")
def files(tmp_path_factory, planar):
    folder = tmp_path_factory.mktemp("recordings")
    return [write(folder, f"{name}.csv", planar, seed) for seed, name in enumerate("abc")]


@pytest.fixture(scope="module")
def once(tmp_path_factory, files):
    root = tmp_path_factory.mktemp("outputs")
    a, b, c = files
    return identified(root, "robot=planar2", f"recordings=[{a},{b}]", f"validation=[{c}]")


def test_a_known_arm_is_found_again(once, planar):
    verdict, folder = once
    assert verdict["validation"]["kind"] == "held out"
    assert verdict["validation"]["nmse_mean"] < 2e-3
    assert verdict["validation"]["unweighted"]["nmse_mean"] < 2e-3
    assert verdict["validation"]["consistent"]["nmse_mean"] < 2e-3
    table = pd.read_csv(folder / "parameters.csv").set_index("name")
    for name, true in (("fv", VISCOUS), ("fc", COULOMB)):
        for j in range(2):
            row = table.loc[f"{name}{j + 1}"]
            assert row.value == pytest.approx(float(true[j]), abs=max(0.05, 4 * row["std"]))
    rigid = table[table.urdf.notna()]
    assert len(rigid) == len(RigidBody(planar).base.values)
    assert (np.abs(rigid.value - rigid.urdf) < 4 * rigid["std"] + 0.02 * np.abs(rigid.urdf) + 1e-3).all()


def test_everything_is_left_in_the_runs_folder(once):
    verdict, folder = once
    assert {path.name for path in folder.iterdir()} >= FILES
    assert not (folder / STAMP).exists()  # which tells of the artifact, not of the run
    assert {"verdict", "reasons", "condition_number", "validation", "training"} <= verdict.keys()
    assert len(verdict["validation"]["nmse"]) == len(verdict["joints"]) == 2
    assert verdict["condition_number"] > 1
    forward = verdict["forward"]["consistent"]
    assert np.array(forward["free"])[-1].max() < 0.1 and np.array(forward["held"])[-1].max() < 0.05  # rad
    checked = json.loads((folder / "check.json").read_text())
    assert [one["name"] for one in checked] == ["a.csv", "b.csv", "c.csv"]
    assert not list(folder.parents[1].glob("**/*.tmp")) and not list(folder.parents[1].glob("**/*.work"))
    text = (folder / "report.html").read_text()
    assert "planar2" in text and "c.csv" in text


def test_where_the_converter_is_the_model_is_left_as_usd(once):
    pytest.importorskip("urdf_usd_converter")
    from pxr import Usd, UsdPhysics

    folder = once[1]
    stage, links = Usd.Stage.Open(str(folder / "planar2.usdc")), pd.read_csv(folder / "links.csv")
    bodies = {prim.GetName(): UsdPhysics.MassAPI(prim) for prim in stage.Traverse()}
    for link in links.itertuples():
        assert bodies[link.link].GetMassAttr().Get() == pytest.approx(link.m, rel=1e-6)


def test_the_urdf_is_that_of_the_consistent_links(once, planar):
    _, folder = once
    arm = load_robot(folder / "planar2.urdf")
    model = json.loads((folder / "parameters.json").read_text())
    links = torch.tensor(model["consistent"]["inertial_parameters"], dtype=torch.float64)
    generator = torch.Generator().manual_seed(0)
    states = [torch.randn(50, 2, generator=generator, dtype=torch.float64) for _ in range(3)]
    torch.testing.assert_close(
        RigidBody(arm).torque(*states), RigidBody(planar).torque(*states, links), atol=1e-9, rtol=0
    )


@pytest.fixture(scope="module")
def consistent(once, planar):
    """Torques of the consistent model [N·m], at states that move, and those states, (50, 2) each."""
    model = json.loads((once[1] / "parameters.json").read_text())
    numbers = model["consistent"]
    links = torch.tensor(numbers["inertial_parameters"], dtype=torch.float64)
    terms = {name: torch.tensor(x, dtype=torch.float64) for name, x in numbers["terms"].items()}
    generator = torch.Generator().manual_seed(0)
    q, dq, ddq = (torch.randn(50, 2, generator=generator, dtype=torch.float64) for _ in range(3))
    q = q.clamp(-2, 2)  # within the limits, which MuJoCo enforces
    dq = dq + 0.3 * dq.sign()  # where a smooth sign is one
    torque = RigidBody(planar).torque(q, dq, ddq, links) + terms["offset"]
    torque += terms["viscous"] * dq + terms["coulomb"] * torch.tanh(dq / model["sign_width"])
    return torque, (q, dq, ddq), terms


def python_class(folder):
    """The class that a run left in its folder."""
    spec = importlib.util.spec_from_file_location("planar2_model", folder / "model.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.TorqueModel()


def test_the_python_class_gives_the_consistent_models_torques(once, consistent):
    verdict, folder = once
    model, (torque, states, _) = python_class(folder), consistent
    assert model.joints == ["shoulder", "elbow"]
    assert model.method == verdict["use"] == "consistent" and "Use the consistent" in verdict["advice"]
    assert verdict["validation"]["nmse"] == verdict["validation"]["consistent"]["nmse"]
    for row, *state in zip(torque.numpy(), *(x.numpy() for x in states)):
        np.testing.assert_allclose(model.torque(*state), row, rtol=0, atol=1e-9)
    q, dq, ddq = (x[0].numpy() for x in states)
    inertia = model.torque(q, dq, ddq) - model.gravity(q) - model.friction(dq)
    coriolis = model.torque(q, dq, 0 * ddq) - model.gravity(q) - model.friction(dq)
    np.testing.assert_allclose(model.mass_matrix(q) @ ddq, inertia - coriolis, rtol=0, atol=1e-9)


@pytest.fixture
def recorded(once, files, monkeypatch):
    """The address of the model in the MLflow run of the same command, whose artifact is there."""
    folder = once[1]
    outputs, (a, b, c) = folder.parents[1], files
    given = f"recordings=[{a},{b}]", f"validation=[{c}]", f"outputs={outputs}"
    kept = "tracking=local", "tracking.patience=0"
    run_stages(validate(composed("+experiment=identify", "robot=planar2", *given, *kept)), folder, "again")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{outputs / 'mlflow.db'}")
    (run,) = client_of(outputs).search_runs(["1"])
    return f"runs:/{run.info.run_id}/identify"


@pytest.mark.parametrize("source", ["folder", "run"])
def test_mlflow_loads_the_same_from_the_folder_and_by_the_run(once, consistent, source, request):
    import mlflow

    folder, (torque, states, _) = once[1], consistent
    address = str(folder) if source == "folder" else request.getfixturevalue("recorded")
    names = [f"{letter}_{joint}" for letter in ("q", "dq", "ddq") for joint in ("shoulder", "elbow")]
    table = pd.DataFrame(torch.cat(states, 1).numpy(), columns=names)[names[::-1]]
    table.index = table.index + 100
    found = mlflow.pyfunc.load_model(address).predict(table)
    assert [*found.columns] == ["tau_shoulder", "tau_elbow"] and found.index.equals(table.index)
    np.testing.assert_allclose(found.to_numpy(), torque.numpy(), rtol=0, atol=1e-9)
    with pytest.raises(mlflow.exceptions.MlflowException, match="q_elbow"):
        mlflow.pyfunc.load_model(address).predict(table.drop(columns="q_elbow"))


def test_the_python_class_is_the_weighted_model_where_that_predicts_better(planar, tmp_path):
    """An arm whose second link has moments of inertia below zero, as unmodelled effects may make it look."""
    links = planar.inertial_parameters.clone()
    links[1, 4:] *= -2
    time, names = np.arange(30 * 200) / 200, []
    for seed in range(2):
        generator = torch.Generator().manual_seed(seed)
        strange = moved(replace(planar, inertial_parameters=links), time, VISCOUS, COULOMB, generator)
        names.append(tmp_path / f"{seed}.csv")
        frame(strange).to_csv(names[-1], index=False)
    verdict, folder = identified(
        tmp_path, "robot=planar2", f"recordings=[{names[0]}]", f"validation=[{names[1]}]"
    )
    errors = verdict["validation"]
    assert verdict["use"] == "weighted" and "Use the weighted" in verdict["advice"]
    assert errors["nmse_mean"] == errors["weighted"]["nmse_mean"] < errors["consistent"]["nmse_mean"] / 1.1
    numbers = json.loads((folder / "parameters.json").read_text())
    width = numbers["sign_width"]
    body = TorqueModel(RigidBody(planar), settings(Terms, "model/joint_torque", sign_width=width))
    assert list(body.names) == numbers["names"]
    theta, model = torch.tensor(numbers["parameters"], dtype=torch.float64), python_class(folder)
    states = [torch.randn(20, 2, generator=generator, dtype=torch.float64) for _ in range(3)]
    for row, *state in zip(body.torque(theta, *states).numpy(), *(x.numpy() for x in states)):
        np.testing.assert_allclose(model.torque(*state), row, rtol=0, atol=1e-9)  # N·m
    mujoco.MjModel.from_xml_path(str(folder / "planar2.xml"))  # of the consistent one: it exists


def test_mujocos_inverse_dynamics_of_the_mjcf_are_the_consistent_models(once, consistent):
    _, folder = once
    torque, states, terms = consistent
    model = mujoco.MjModel.from_xml_path(str(folder / "planar2.xml"))
    data = mujoco.MjData(model)
    for row, *state in zip((torque - terms["offset"]).numpy(), *(x.numpy() for x in states)):
        data.qpos[:], data.qvel[:], data.qacc[:] = state
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse, row, rtol=0, atol=1e-6)  # N·m; MuJoCo knows no offset


def test_pinocchio_reads_friction_from_the_urdf(once, consistent):
    _, folder = once
    *_, terms = consistent
    model = pin.buildModelFromUrdf(str(folder / "planar2.urdf"))
    np.testing.assert_allclose(model.damping, terms["viscous"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(model.upperDryFrictionLimit, terms["coulomb"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("stage", ["identify", "check"])
def test_an_arm_that_nobody_named_is_asked_for(files, tmp_path, stage):
    with pytest.raises(ConfigError, match=r"which arm was recorded\? robot.name="):
        identified(tmp_path, f"recordings=[{files[0]}]", f"stages=[{stage}]")


def test_a_check_fits_nothing(files, tmp_path, capsys):
    folder = tmp_path / "runs" / "check"
    config = configured(tmp_path, "robot=planar2", f"recordings=[{files[0]}]", "stages=[check]")
    run_stages(config, folder, "check")
    (checked,) = json.loads((folder / "check.json").read_text())
    assert checked["samples"] == 6000 and checked["condition"] > 1
    assert {path.name for path in folder.iterdir()} == {"check.json"}
    shown = capsys.readouterr().out
    for word in ("a.csv", "noise floor", "saturated", "elbow", "base parameter"):
        assert word in shown


def test_the_same_again_is_reused_and_other_recordings_are_not(once, files, tmp_path):
    _, first = once
    root = first.parents[1]
    made = {path: path.stat().st_mtime_ns for path in root.glob("identify/*/stamp.json")}
    names = ("robot=planar2", f"recordings=[{files[0]},{files[1]}]", f"validation=[{files[2]}]")
    _, again = identified(root, *names, run="again")
    assert {path: path.stat().st_mtime_ns for path in root.glob("identify/*/stamp.json")} == made
    assert (again / "report.html").read_bytes() == (first / "report.html").read_bytes()
    copy = tmp_path / files[2].name
    copy.write_text("".join(files[2].read_text().splitlines(keepends=True)[:-1]))
    identified(root, *names[:2], f"validation=[{copy}]", run="other")
    assert len(list(root.glob("identify/*/stamp.json"))) == len(made) + 1


def test_one_recording_is_tested_on_itself_and_a_library_gives_what_to_run_next(files, tmp_path, planar):
    from sidegan.library.measure import measured
    from sidegan.motion.trajectory import Trajectory
    from sidegan.validity import Constraints

    trajectory = Trajectory(2, 3, 8.0)
    c = 0.3 * torch.randn(6, 2, 3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    measured(Constraints(planar, []), trajectory, c, "made").save(tmp_path / "library.parquet")
    settings = (f"identify.library={tmp_path / 'library.parquet'}", "identify.recommend=3")
    verdict, folder = identified(tmp_path, "robot=planar2", f"recordings=[{files[0]}]", *settings)
    assert len(verdict["next_trajectories"]) == 3 and set(verdict["next_trajectories"]) <= set(range(6))
    assert "run trajectory" in (folder / "report.html").read_text()
    assert verdict["validation"]["kind"].startswith("in sample")
    assert verdict["validation"]["nmse"] == verdict["training"]["nmse"]  # the same numbers, shown twice
    assert any("held out" in reason for reason in verdict["reasons"])


def test_the_last_part_of_a_recording_can_be_held_out(files, tmp_path):
    verdict, folder = identified(tmp_path, "robot=planar2", f"recordings=[{files[0]}]", "validation=0.3")
    assert verdict["validation"]["kind"] == "held out" and verdict["validation"]["nmse_mean"] < 5e-3
    assert verdict["validation"]["recordings"] == ["a.csv, last 30%"]
    assert "validation=0.3" in (folder / "report.html").read_text()
    with pytest.raises(ConfigError, match=r"validation is 1\.5, expected a list.*, or a number > 0 and < 1"):
        configured(tmp_path, "validation=1.5")


def test_a_bad_recording_leaves_nothing(files, tmp_path, planar):
    broken = tmp_path / "broken.csv"
    table = pd.read_csv(files[1])
    table.assign(tau1=0.0, tau2=0.0).to_csv(broken, index=False)
    with pytest.raises(RecordingError, match="every torque is zero"):
        identified(tmp_path, "robot=planar2", f"recordings=[{files[0]},{broken}]")
    assert not list((tmp_path / "identify").glob("*/*.json"))
    assert not {path.name for path in (tmp_path / "runs" / "run").glob("*")} & FILES
    with pytest.raises(RecordingError, match=r"there is no file none\.csv"):
        identified(tmp_path, "robot=planar2", "recordings=[none.csv]")
    with pytest.raises(RecordingError, match="no column 'q3'"):
        identified(tmp_path, "robot=kuka_lwr4", f"recordings=[{files[0]}]")


def test_a_recording_is_not_held_out_under_another_name(files, tmp_path):
    lines = files[0].read_text().splitlines(keepends=True)
    (files[0].parent / "x").mkdir()
    names = {"again.csv": lines, "part.csv": [lines[0], *lines[3000:3400]]}
    for name, content in names.items():
        (tmp_path / name).write_text("".join(content))
    for other in (files[0].parent / "x" / ".." / files[0].name, *(tmp_path / name for name in names)):
        with pytest.raises(RecordingError, match=r"holds samples of a\.csv"):
            identified(tmp_path, "robot=planar2", f"recordings=[{files[0]}]", f"validation=[{other}]")


def test_conditions_that_cannot_be_met_leave_nothing(files, tmp_path):
    with pytest.raises(InfeasibleError, match="infeasible"):
        identified(tmp_path, "robot=planar2", f"recordings=[{files[0]}]", "identify.total_mass=1e-9")
    assert not list((tmp_path / "identify").glob("*/*.json"))


def test_a_description_that_cannot_exist_is_refused_by_link(files, tmp_path, planar):
    import re

    text = planar.urdf.read_text()
    impossible = re.sub(r'ixx="[^"]*"', 'ixx="9"', text)
    (tmp_path / "bad.urdf").write_text(impossible)
    with pytest.raises(RobotError, match="upper_arm"):
        identified(tmp_path, f"robot.name={tmp_path / 'bad.urdf'}", f"recordings=[{files[0]}]")


def test_a_robots_name_leads_nowhere_else(files, tmp_path, planar):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(planar.urdf.read_text().replace('name="planar2"', 'name="../../../evil"'))
    outputs = tmp_path / "deep" / "outputs"
    _, folder = identified(outputs, "robot=planar2", f"robot.name={urdf}", f"recordings=[{files[0]}]")
    assert not [path for path in tmp_path.rglob("*evil*") if outputs not in path.parents]
    assert (folder / "evil.urdf").is_file()


def test_settings_that_make_no_sense_are_refused(files, tmp_path):
    with pytest.raises(ConfigError, match="recordings is empty"):
        identified(tmp_path, "robot=planar2")
    with pytest.raises(ConfigError, match="magic"):
        identified(tmp_path, "robot=planar2", f"recordings=[{files[0]}]", "+identify.settings.magic=1")
    with pytest.raises(ConfigError, match="would not be held out"):
        configured(tmp_path, "recordings=[a.csv]", "validation=[a.csv]")
    with pytest.raises(ConfigError, match=r"recordings has a\.csv twice"):
        configured(tmp_path, "recordings=[a.csv,a.csv]")
    with pytest.raises(ConfigError, match=r"recording\.units\.angle is 'turn'"):
        configured(tmp_path, "recording.units.angle=turn")
    with pytest.raises(ConfigError, match=r"identify\.method is 'magic'"):
        configured(tmp_path, "identify.method=magic")


def test_no_other_artifact_depends_on_these_settings(tmp_path):
    one = Task(tiny(f"outputs={tmp_path}"), Store(tmp_path))
    other = Task(tiny(f"outputs={tmp_path}", "robot.gains=[1,1]"), Store(tmp_path))
    assert seed_set(one).digest == seed_set(other).digest
    for ours, theirs in zip(excitation_sets(one), excitation_sets(other), strict=True):
        assert identification(one, ours).digest == identification(other, theirs).digest
    assert not any(one.cfg.has(group) for group in ("model", "recording", "identify"))


def test_an_arm_of_a_thousandth_of_its_weight_is_not_good(files, tmp_path):
    """Torques in N·m that were declared to be in mN·m."""
    a, b, _ = files
    given = (f"recordings=[{a}]", f"validation=[{b}]", "recording.units.torque=mNm")
    verdict, _ = identified(tmp_path, "robot=planar2", *given)
    assert verdict["verdict"] == "usable" and verdict["validation"]["nmse_mean"] < 5e-3
    assert any("is the unit of the torques another one?" in reason for reason in verdict["reasons"])


def test_gains_by_a_load_that_was_not_there_are_no_setting(files, tmp_path, caplog):
    for path in files[:2]:
        table = pd.read_csv(path).rename(columns={"tau1": "i1", "tau2": "i2"})
        table.assign(i1=table.i1 / 5, i2=table.i2 / 5).to_csv(tmp_path / path.name, index=False)
    given = (f"recordings=[{tmp_path / 'a.csv'}]", f"loaded=[{tmp_path / 'b.csv'}]", "load.mass=1")
    words = ("+experiment=gains", "tracking=off", f"outputs={tmp_path}", "robot=planar2", *given)
    with pytest.raises(RecordingError, match="the load is not seen in the currents"):
        run_stages(validate(composed(*words, "load.centre=[0.05,0,0]")), tmp_path / "run", "gains")
    assert "robot.gains=[" not in caplog.text and not (tmp_path / "run" / "gains.json").exists()


def test_the_command_works_as_it_is_told(files, tmp_path, monkeypatch):
    a, b, c = files
    words = ["+experiment=identify", "robot=planar2", f"recordings=[{a},{b}]", f"validation=[{c}]"]
    monkeypatch.setattr(sys, "argv", ["run", *words, "tracking=off", f"outputs={tmp_path}"])
    assert main() == 0
    (verdict,) = tmp_path.glob("runs/identify/*/verdict.json")
    assert json.loads(verdict.read_text())["validation"]["nmse_mean"] < 2e-3


@pytest.mark.parametrize(("train", "test"), [("20s8h", "20s10h"), ("20s10h", "20s8h")])
def test_the_ur10e_predicts_a_recording_it_has_not_seen(tmp_path, train, test):
    train, test = (real(f"ur10e/recorded_{name}.csv") for name in (train, test))
    urdf = f"robot.name={real('ur10e/reference.urdf')}"
    verdict, _ = identified(tmp_path, "robot=ur10e", urdf, f"recordings=[{train}]", f"validation=[{test}]")
    assert verdict["validation"]["nmse_mean"] <= 0.008
    assert verdict["validation"]["unweighted"]["nmse_mean"] <= 0.018
    assert verdict["validation"]["consistent"]["nmse_mean"] <= 0.0028
    assert verdict["validation"]["weighted"]["nmse_mean"] <= 0.0031
    assert verdict["use"] == "consistent" and verdict["verdict"] == "good"


def test_the_lwr_recording_is_told_apart_from_a_good_one(tmp_path):
    path = real("kuka_lwr4/recorded_hw1_50hz.csv")
    for choice in ("csv", "lwr4"):
        verdict, folder = identified(
            tmp_path, "robot=kuka_lwr4", f"recording={choice}", f"recordings=[{path}]", run=choice
        )
        assert max(verdict["validation"]["nmse"][:4]) <= 0.02
        assert max(verdict["validation"]["unweighted"]["nmse"][:4]) <= 0.02
        reasons = "\n".join(verdict["reasons"])
        assert "poorly excited" in reasons and "not identifiable" in reasons
        assert verdict["use"] == "weighted"  # no bodies that can exist explain the wrist's torques
        assert len(verdict["weak_parameters"]) > 10
        joints = [one.partition(" (")[0] for one in verdict["reasons"] if one.startswith("joint ")]
        assert len(set(joints)) == len(joints) and "friction drives no joint" in reasons
        report = (folder / "report.html").read_text()
        assert "poorly excited" in report and verdict["weak_parameters"][0] in report
