"""Trajectories to execute: files for controllers, the table of the set, its page and its rehearsal."""

import html
import re
import shlex
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from sidegan.errors import ArtifactError, InfeasibleError
from sidegan.library import Library
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import excite
from sidegan.robot import load_robot, setting, with_effort
from sidegan.steps import trajectories
from sidegan.validity import Constraints, check
from tests.refusals import refused
from tests.tiny import tiny


def excited(outputs, folder, *overrides):
    """The folder, in which a run with changed settings left its files."""
    run_stages(tiny(f"outputs={outputs}", *overrides, experiment="excite"), folder, "excite")
    return folder


@pytest.fixture
def ran(outputs, tmp_path):
    """Runs with changed settings, all in the same folder."""
    return partial(excited, outputs, tmp_path / "run")


@pytest.fixture(scope="module")
def folder(outputs, tmp_path_factory):
    """Folder of a run that made trajectories to execute."""
    return excited(outputs, tmp_path_factory.mktemp("excite"))


STATES = [f"{kind}_{joint}" for kind in ("q", "dq", "ddq") for joint in ("shoulder", "elbow")]


def course(folder, name):
    """The table of a trajectory that is to be executed."""
    return pd.read_csv(folder / "trajectories" / f"{name}.csv")


def percent(cell):
    return float(cell.split("%")[0])


def test_every_trajectory_is_valid_and_written_exactly(folder):
    arm = with_effort(load_robot("planar2"), 0.8)
    chosen = Library.load(folder / "library.parquet", arm)
    family = Trajectory(2, 3, 8.0)
    assert len(chosen) == 6 and check(Constraints(arm), family, chosen.coefficients).valid.all()
    motion = np.concatenate(family.roll_out(chosen.coefficients, family.times(20))[1:], 2)
    for k in range(6):
        np.testing.assert_allclose(course(folder, k + 1)[STATES], motion[k], rtol=0, atol=1e-7)
    assert course(folder, "all").time.iloc[-1] == 6 * 8 + 5  # with a second between two
    table = pd.read_csv(folder / "set.csv")
    assert list(table.trajectory) == [1, 2, 3, 4, 5, 6] and table["energy [J]"].is_monotonic_increasing
    assert (table["peak velocity"].map(percent) <= 100).all() and (table["clearance [m]"] >= 0.02).all()
    assert {path.suffix for path in (folder / "trajectories").iterdir()} == {".csv", ".yaml"}
    assert (folder / "view.html").resolve().as_uri() in (folder / "set.md").read_text()


def test_files_are_in_the_coordinates_of_the_controller(ran):
    """Its second angle counts from the horizontal."""
    coupling = "controllers.coupling={elbow: {elbow: 1, shoulder: -1}}"
    counted = ran(coupling, "controllers.start=[0.4,0.1]", "goal.count=2", "controllers.formats=[csv]")
    chosen, family = Library.load(counted / "library.parquet").coefficients, Trajectory(2, 3, 8.0)
    joints = np.array([[1.0, 0.0], [-1.0, 1.0]])
    for k, motion in enumerate(family.roll_out(chosen, family.times(20)).position, 1):
        np.testing.assert_allclose(course(counted, k)[STATES[:2]] @ joints.T, motion, rtol=0, atol=1e-7)
    approach = course(counted, "approach")[STATES[:2]].to_numpy()
    np.testing.assert_allclose(approach[[0, -1]], [[0.4, 0.1], [0.0, 0.0]], rtol=0, atol=1e-9)
    _, (then, _), (_, identify) = sections(counted)
    assert "must stand at controllers.start: shoulder 0.4, elbow 0.1" in then
    assert "'recording.coupling={elbow: {elbow: 1, shoulder: -1}}'" in identify


def test_a_first_run_is_slower(ran, folder):
    slow_folder = ran("controllers.speed=0.5", "controllers.formats=[csv]")
    said = (slow_folder / "set.md").read_text()
    assert said.startswith("6 trajectories of 16 s,") and "50% of the speed" in said
    fast, table = (pd.read_csv(source / "set.csv") for source in (folder, slow_folder))
    for column, factor in (("peak acceleration", 4), ("peak jerk", 8)):
        once_and_slow = [source[column].str.split().str[0].astype(float) for source in (fast, table)]
        assert (factor * once_and_slow[1]).to_list() == pytest.approx(once_and_slow[0].to_list(), rel=0.01)
    arm = load_robot("planar2")
    for k, row in table.iterrows():
        frame = course(slow_folder, k + 1)
        states = np.split(frame[STATES].to_numpy(), 3, 1)
        torque, velocity = RigidBody(arm).torque(*states), states[1]
        for name, x in (("velocity", velocity / arm.velocity_limit), ("torque", torque / arm.torque_limit)):
            assert percent(row[f"peak {name}"]) == pytest.approx(100 * np.abs(x).max(), abs=0.6)
        work = np.trapezoid(np.abs(torque * velocity).sum(1), frame.time)
        assert row["energy [J]"] == pytest.approx(work, rel=0.01)


def test_a_slow_run_is_checked_at_its_own_speed(ran, tmp_path, monkeypatch):
    """Where holding takes more torque than there is, at the planned speed the arm may still get through."""
    periods = []

    def weak(constraints, family, c):
        periods.append(family.period)
        arm = replace(constraints.arm, torque_limit=0.01 * constraints.arm.torque_limit)
        return check(Constraints(arm), family, c)

    monkeypatch.setattr(trajectories, "check", weak)
    with refused(InfeasibleError, "trajectory 1", "25%", "torque"):
        ran("controllers.speed=0.25")
    assert periods == [32.0] and not (tmp_path / "run" / "trajectories").exists()


SPARE = "robot.limits.effort={shoulder: 18}"  # N·m, of 16.3 that gravity asks for


@pytest.mark.parametrize(("option", "effort"), [("seed=0", 0.8), (SPARE, 1.0), ("robot.effort=0.4", 0.4)])
def test_default_effort_leaves_a_fifth_of_the_limits_if_possible(context, option, effort):
    made = context(option, experiment="excite")
    whole, used = made.cell.whole_arm, made.cell.arm
    assert made.cell.effort == effort and context().cell.effort == 1.0  # as the paper has it
    assert used.velocity_limit.tolist() == pytest.approx((effort * whole.velocity_limit).tolist())
    assert used.torque_limit.tolist() == pytest.approx((effort * whole.torque_limit).tolist())


def test_acceleration_and_jerk_limits_are_kept_and_peaks_reported(ran, caplog):
    limits = "robot.limits.acceleration={shoulder: 2.0, elbow: 3.0}", "robot.limits.jerk={elbow: 9}"
    with caplog.at_level("INFO"):
        folder = ran(*limits)
    assert "acceleration of 2, jerk of 1, torque of 2" in caplog.text
    table, library = pd.read_csv(folder / "set.csv"), Library.load(folder / "library.parquet")
    peaks = table[["peak acceleration", "peak jerk"]].map(percent)
    assert (peaks <= 100).all().all() and peaks.max().max() > 60
    assert all((library.margins[name] >= 0).all() for name in ("acceleration", "jerk"))
    for k in table.trajectory:
        assert (course(folder, k)[STATES[4:]].abs().max() <= [2, 3]).all()


START = "controllers.start=[0.4,-0.3]"


def sections(folder):
    """What the page says is to be done next: a sentence and a command each."""
    text = html.unescape((folder / "view.html").read_text())
    return re.findall(r'<p class="small">(.*?)</p>\s*<pre>(.*?)</pre>', text, re.DOTALL)


def test_the_page_lists_the_commands_to_send_slow_set_first(ran, folder):
    fast = ran(START, "goal.count=2")
    (slowly, command), (then, send), _ = sections(fast)
    assert slowly.startswith("First slowly") and "speed=0.25" in command and "start=[0.4,-0.3]" in command
    length = re.search(r"order: approach \(([\d.]+) s\), 1 … 2 \(8 s each\), return \(\1 s\)", then)[1]
    assert float(length) == pytest.approx(course(fast, "approach").time.iloc[-1], rel=5e-3)
    assert "must stand at controllers.start: shoulder 0.4, elbow -0.3" in then and "planned speed" in then
    first, *_, last = send.splitlines()
    assert first == f"cd {fast / 'trajectories'}" and last == "send return"
    assert re.findall("^send (.*)", send, re.MULTILINE) == ["approach", "1", "2", "return"]
    assert re.search(r"in this order: approach .*, return", (fast / "set.md").read_text())
    (_, command), (then, send), (_, last) = sections(folder)  # of a run that was not told where the arm is
    assert "controllers.start=[…]" in command and "approach" not in then + send
    assert f"recording=excite recording.sent={folder.resolve()}" in last
    assert "must stand at home first: shoulder 0, elbow 0" in then


def test_commands_on_the_page_read_the_same_files_whatever_their_paths(outputs, tmp_path):
    folder = tmp_path / """it's 50% (of) a, b [1] = {x} ${y} "ä" """.strip()
    folder.mkdir()
    urdf = folder / "arm, 2.urdf"
    urdf.write_text(load_robot("planar2").urdf.read_text())
    run = excited(outputs, folder / "run", *shlex.split(setting("robot.name", urdf)))
    (_, slower), (_, send), (_, identify) = sections(run)
    assert shlex.split(send)[:2] == ["cd", str(run / "trajectories")]
    for command in (slower, identify):
        words = shlex.split(command.replace("\\\n", "").replace("[…]", "[0,0]"))[1:]
        parsed = OverridesParser.create().parse_overrides(words)
        named = {override.key_or_group: override.value() for override in parsed}
        read = OmegaConf.to_container(OmegaConf.create(named), resolve=True)
        assert read["robot.name"] == str(urdf)
        assert read.get("hydra.run.dir", f"{run}-slow") == f"{run}-slow"
        assert read.get("recording.sent", str(run)) == str(run)


def test_a_run_replaces_files_of_an_earlier_run_only(ran):
    first = ran(START, "goal.count=10", "controllers.rehearse=true", "controllers.formats=[csv,ros2]")
    assert {"01.yaml", "approach.yaml"} < {path.name for path in (first / "trajectories").iterdir()}
    (first / "trajectories" / "log.csv").write_text("mine")
    slow = ran("goal.count=3", "controllers.speed=0.25", "controllers.formats=[ros2]")
    left = {path.name for path in (slow / "trajectories").iterdir()}
    assert slow == first and left == {"1.yaml", "2.yaml", "3.yaml", "log.csv"}
    assert not (slow / "rehearsal.csv").exists() and len(pd.read_csv(slow / "set.csv")) == 3
    assert not [path for path in slow.iterdir() if path.name.startswith(".")]
    (then, send), _ = sections(slow)
    assert re.findall(r"^send (\w+)", send, re.MULTILINE) == ["1", "2", "3"]  # the path may have any digits
    assert then.startswith("This set, at 25% of the planned speed") and "1 … 3 (32 s each)" in then


def test_a_page_that_cannot_be_made_costs_only_the_page(ran, monkeypatch, caplog):
    def fail(*_):
        raise ArtifactError("no template")

    monkeypatch.setattr(trajectories.TrajectorySet, "view", fail)
    folder = ran("goal.count=1")
    assert "there is no view.html: no template" in caplog.text and course(folder, 1).time.iloc[-1] == 8
    assert not (folder / "view.html").exists() and "view:" not in (folder / "set.md").read_text()


def test_a_goal_too_long_for_the_shell_is_read_from_stdin(ran, monkeypatch):
    monkeypatch.setattr(excite, "SHELL", 1000)  # bytes, for 128 kB, which 20 harmonics of seven joints have
    (_, send) = sections(ran("goal.count=1"))[1]
    assert "--stdin < $1.yaml" in send and "Jazzy" in send and "cat" not in send
