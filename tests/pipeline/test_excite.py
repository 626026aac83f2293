"""Trajectories to execute: files for controllers, the table of the set, its page and its rehearsal."""

import json
import re
from dataclasses import replace

import pandas as pd
import pytest
import torch
import yaml

from sidegan.errors import ConfigError, InfeasibleError
from sidegan.library import Library
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import excite
from sidegan.robot import load_robot, with_effort
from sidegan.validity import Constraints, check
from tests.tiny import tiny


@pytest.fixture
def ran(outputs, tmp_path):
    """Folder of a run with changed settings, on the seeds that are there."""

    def made(*overrides, name="run"):
        config = tiny(f"outputs={outputs}", *overrides, experiment="excite")
        run_stages(config, tmp_path / name, "excite")
        return tmp_path / name

    return made


@pytest.fixture(scope="module")
def folder(outputs, tmp_path_factory):
    """Folder of a run that made trajectories to execute."""
    folder = tmp_path_factory.mktemp("excite")
    run_stages(tiny(f"outputs={outputs}", experiment="excite"), folder, "excite")
    return folder


def test_every_trajectory_is_valid_and_is_written_as_it_is(folder):
    arm = with_effort(load_robot("planar2"), 0.8)
    chosen = Library.load(folder / "library.parquet", arm)
    family = Trajectory(2, 3, 8.0)
    assert len(chosen) == 6 and check(Constraints(arm), family, chosen.coefficients).valid.all()
    motion = family.roll_out(chosen.coefficients, family.times(20))
    for k in range(6):
        frame = pd.read_csv(folder / "trajectories" / f"{k + 1}.csv")
        assert list(frame.columns[:3]) == ["time", "q_shoulder", "q_elbow"]
        for kind, x in zip(("q", "dq", "ddq"), motion[1:]):
            written = frame[[f"{kind}_shoulder", f"{kind}_elbow"]].to_numpy()
            assert abs(written - x[k].numpy()).max() < 1e-7


def test_all_in_a_row_are_one_motion_at_rest_in_between(folder):
    whole = pd.read_csv(folder / "trajectories" / "all.csv")
    assert len(whole) == 6 * 161 and whole.time.iloc[-1] == pytest.approx(6 * 8 + 5)  # a second between two
    rest = whole.iloc[::161]
    assert abs(rest[["q_shoulder", "q_elbow", "dq_shoulder", "dq_elbow"]].to_numpy()).max() < 1e-7


def test_the_least_demanding_comes_first_and_has_a_goal_for_ros(folder):
    table = pd.read_csv(folder / "set.csv")
    assert list(table.trajectory) == [1, 2, 3, 4, 5, 6] and table["energy [J]"].is_monotonic_increasing
    assert (table["peak velocity"].map(percent) <= 100).all() and (table["clearance [m]"] >= 0.02).all()
    goal = yaml.safe_load((folder / "trajectories" / "1.yaml").read_text())
    assert goal["trajectory"]["joint_names"] == ["shoulder", "elbow"]
    assert {path.suffix for path in (folder / "trajectories").iterdir()} == {".csv", ".yaml"}


def test_a_first_run_is_slower(ran, folder):
    slow_folder = ran("stages=[excite]", "controllers.speed=0.5", "controllers.formats=[csv,mcap]")
    once, slow = (pd.read_csv(one / "trajectories" / "1.csv") for one in (folder, slow_folder))
    assert len(slow) == 2 * len(once) - 1 and slow.time.iloc[-1] == 2 * once.time.iloc[-1]
    assert abs(slow.q_elbow[::2].to_numpy() - once.q_elbow.to_numpy()).max() < 1e-7
    assert abs(2 * slow.dq_elbow[::2].to_numpy() - once.dq_elbow.to_numpy()).max() < 1e-7
    assert (slow_folder / "trajectories" / "all.mcap").is_file()
    said = (slow_folder / "set.md").read_text()
    assert said.startswith("6 trajectories of 16 s,") and "50% of the speed" in said
    fast, table = (pd.read_csv(one / "set.csv") for one in (folder, slow_folder))
    for column, factor in (("acceleration [rad/s²]", 4), ("jerk [rad/s³]", 8)):
        assert (factor * table[f"peak {column}"]).to_list() == pytest.approx(fast[f"peak {column}"], rel=0.01)
    arm, body = load_robot("planar2"), RigidBody(load_robot("planar2"))
    names = [f"{kind}_{joint}" for kind in ("q", "dq", "ddq") for joint in ("shoulder", "elbow")]
    for k, row in table.iterrows():
        frame = pd.read_csv(slow_folder / "trajectories" / f"{k + 1}.csv")
        states = torch.tensor(frame[names].to_numpy()).split(2, 1)
        torque, velocity = body.torque(*states), states[1]
        assert percent(row["peak velocity"]) == pytest.approx(most(velocity, arm.velocity_limit), abs=0.6)
        assert percent(row["peak torque"]) == pytest.approx(most(torque, arm.torque_limit), abs=0.6)
        work = torch.trapezoid((torque * velocity).abs().sum(1), torch.tensor(frame.time.to_numpy()))
        assert row["energy [J]"] == pytest.approx(float(work), rel=0.01)


def percent(cell):
    return float(cell.rstrip("%"))


def most(x, limit):
    """Largest share of a limit, in per cent."""
    return 100 * float((x.abs() / limit).max())


def test_the_way_from_where_the_arm_is_to_home_and_back(ran):
    folder = ran("controllers.start=[0.4,-0.6]", "selection.count=1") / "trajectories"
    there, back = (pd.read_csv(folder / f"{name}.csv") for name in ("approach", "return"))
    assert there[["q_shoulder", "q_elbow"]].iloc[0].tolist() == [0.4, -0.6]
    assert abs(there[["q_shoulder", "q_elbow"]].iloc[-1]).max() < 1e-9
    assert back[["q_shoulder", "q_elbow"]].iloc[-1].tolist() == pytest.approx([0.4, -0.6])
    assert (folder / "approach.yaml").is_file()
    assert (folder.parent / "set.md").read_text().startswith("1 trajectory of 8 s,")


def test_an_arm_that_motion_helps_to_hold_is_not_slowed_down(ran, tmp_path, monkeypatch):
    """Where holding takes more torque than there is, at the planned speed the arm may still get through."""
    refused = []

    def weak(constraints, family, c):
        refused.append(family.period)
        arm = replace(constraints.arm, torque_limit=0.01 * constraints.arm.torque_limit)
        return check(Constraints(arm), family, c)

    monkeypatch.setattr(excite, "check", weak)
    with pytest.raises(InfeasibleError, match=r"trajectory 1 cannot be run at 25% of the speed: torque"):
        ran("stages=[excite]", "controllers.speed=0.25")
    assert refused == [32.0] and not (tmp_path / "run" / "trajectories").exists()


def test_a_rehearsal_tells_how_the_arm_would_follow(ran):
    options = ("stages=[excite]", "controllers.rehearse=true", "controllers.formats=[csv]")
    runs = ran(*options, name="fast"), ran(*options, "controllers.speed=0.5", name="slow")
    once, slower = (pd.read_csv(run / "rehearsal.csv") for run in runs)
    assert len(once) == len(slower) == 6
    error = [one["tracking error [rad]"].str.split().str[0].astype(float) for one in (once, slower)]
    assert (error[0] > 0).all() and error[1].mean() < error[0].mean() < 0.1
    assert (once["closest [m]"].astype(float) > -0.01).all()
    with pytest.raises(InfeasibleError, match="does not follow"):
        ran(*options, "plant.tolerance=1e-6", name="stiff")


def test_a_page_shows_the_arm_moving_and_is_linked_from_the_table(folder):
    text = (folder / "view.html").read_text()
    titles = [
        f"{k} · cond {x:.3g}" for k, x in enumerate(Library.load(folder / "library.parquet").fitness, 1)
    ]
    head = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])
    assert head["titles"] == titles and head["joints"] == ["shoulder", "elbow"]
    assert (folder / "view.html").resolve().as_uri() in (folder / "set.md").read_text()
    table = pd.read_csv(folder / "set.csv", dtype=str)
    rows = [re.findall("<td>(.*?)</td>", row) for row in re.findall("<tr>(.*?)</tr>", text)]
    assert [row for row in rows if row] == table.to_numpy().tolist()
    assert f"recording=excite recording.sent={folder.resolve()}" in text and "1.yaml)" in text


def test_a_generator_may_be_the_pool(ran):
    options = "gan=exact", "stages=[gan,library,excite]", "excite=[exact]", "library.count=8"
    assert Library.load(ran(*options) / "library.parquet").source == ["exact"] * 6
    with pytest.raises(ConfigError, match=r"selection\.count is 9, but exact hold 8 trajectories"):
        ran(*options, "selection.count=9")


SPARE = "robot.limits.effort={shoulder: 18}"  # N·m, of 16.3 that gravity asks for


@pytest.mark.parametrize(("option", "effort"), [("seed=0", 0.8), (SPARE, 1.0), ("robot.effort=0.4", 0.4)])
def test_a_first_run_leaves_a_fifth_of_the_limits_to_an_arm_that_has_it(ran, task, caplog, option, effort):
    made = task(option, experiment="excite")
    whole, used = made.whole_arm, made.arm
    assert made.effort == effort and task().effort == 1.0  # as the paper has it
    assert used.velocity_limit.tolist() == pytest.approx((effort * whole.velocity_limit).tolist())
    assert used.torque_limit.tolist() == pytest.approx((effort * whole.torque_limit).tolist())
    with caplog.at_level("INFO"):
        folder = ran(option)
    assert f"effort: {effort:.0%} of the velocity and torque" in caplog.text or option == "robot.effort=0.4"
    table = pd.read_csv(folder / "set.csv")
    assert table["peak velocity"].map(percent).max() <= 100 * effort
    for k in table.trajectory:
        speed = pd.read_csv(folder / "trajectories" / f"{k}.csv")[["dq_shoulder", "dq_elbow"]].abs().max()
        assert (speed.to_numpy() <= used.velocity_limit.numpy() + 1e-6).all()


LIMITED = ("robot.limits.acceleration={shoulder: 2.0, elbow: 3.0}", "robot.limits.jerk={elbow: 9}")


def test_accelerations_and_jerks_keep_their_limits_and_their_peaks_are_told(ran, caplog):
    with caplog.at_level("INFO"):
        folder = ran(*LIMITED)
    assert "acceleration of 2, jerk of 1, torque of 2" in caplog.text
    table, library = pd.read_csv(folder / "set.csv"), Library.load(folder / "library.parquet")
    peaks = table[["peak acceleration", "peak jerk"]].map(percent)
    assert (peaks <= 100).all().all() and peaks.max().max() > 60
    assert (library.margins["acceleration"] >= 0).all() and (library.margins["jerk"] >= 0).all()
    family = Trajectory(2, 3, 8.0)
    jerk = family.derivative(library.coefficients, family.times(2000.0), 3)[..., 1].abs()
    assert float(jerk.max()) <= 9
    for k in table.trajectory:
        frame = pd.read_csv(folder / "trajectories" / f"{k}.csv")
        assert frame.ddq_shoulder.abs().max() <= 2 and frame.ddq_elbow.abs().max() <= 3
