"""The table of arms: an independent check that finds what is wrong, remedies, and going on where it was."""

import ast
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch

from benchmarks import arms, independent
from benchmarks.independent import Facts, Robot, check_file, check_folder
from benchmarks.remedies import followed, remedied
from sidegan.errors import InfeasibleError, RobotError, SideganError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot.load import _MODELS
from sidegan.robot.setup import Limits

FILE = _MODELS / "planar2.urdf"
FAMILY = Trajectory(2, 3, 8.0)


def written(path, motion, names=("shoulder", "elbow")):
    """A CSV file of one motion."""
    rows = torch.cat([motion.time[:, None], *(x[0] for x in motion[1:])], 1).numpy()
    columns = ["time", *(f"{kind}_{name}" for kind in ("q", "dq", "ddq") for name in names)]
    pd.DataFrame(rows, columns=columns).to_csv(path, index=False, float_format="%.12g")
    return path


@pytest.fixture
def motion():
    c = 0.2 * torch.randn(1, 2, 3, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    return FAMILY.roll_out(c, FAMILY.times(1000.0))


def test_nothing_of_ours_takes_part():
    tree = ast.parse(Path(independent.__file__).read_text("utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = [alias.name for node in imports for alias in node.names]
    names += [node.module for node in imports if isinstance(node, ast.ImportFrom)]
    assert not [name for name in names if name.startswith(("sidegan", "benchmarks", "torch"))]


def test_a_good_trajectory_is_good_and_its_numbers_are_the_motions(planar, motion, tmp_path):
    robot = Robot(FILE, ["shoulder", "elbow"], Facts(floor=-1.0))
    found = check_file(robot, written(tmp_path / "1.csv", motion))
    torque = RigidBody(planar).torque(*motion[1:])
    assert found["valid"] and found["colliding"] == 0
    assert found["velocity"] == pytest.approx(float((motion.velocity.abs() / planar.velocity_limit).max()))
    assert found["effort"] == pytest.approx(float((torque.abs() / planar.torque_limit).max()), rel=1e-9)
    assert found["acceleration"] == found["jerk"] == 0 and found["consistent"] < 1e-4


@pytest.mark.parametrize(
    ("facts", "kind"),
    [
        (Facts(limits={"velocity": {"elbow": 0.01}}), "velocity"),
        (Facts(limits={"acceleration": {"elbow": 0.01}}), "acceleration"),
        (Facts(limits={"jerk": {"shoulder": 0.01}}), "jerk"),
        (Facts(limits={"effort": {"shoulder": 0.1}}), "effort"),
        (Facts(limits={"position": {"elbow": [-1e-3, 1e-3]}}), "position"),
    ],
)
def test_every_limit_can_be_violated(motion, tmp_path, facts, kind):
    found = check_file(Robot(FILE, ["shoulder", "elbow"], facts), written(tmp_path / "1.csv", motion))
    assert not found["valid"] and found[kind] > 1


def test_rates_that_are_not_those_of_the_positions_are_found(motion, tmp_path):
    lying = motion._replace(velocity=0.9 * motion.velocity)
    found = check_file(Robot(FILE, ["shoulder", "elbow"], Facts()), written(tmp_path / "1.csv", lying))
    assert not found["valid"] and found["consistent"] > 1e-2


def folded(angle):
    """A motion of the elbow alone to an angle [rad] and back."""
    time = FAMILY.times(100.0)
    q = torch.zeros(1, len(time), 2, dtype=torch.float64)
    wave = torch.sin(torch.pi * time / FAMILY.period) ** 4
    q[0, :, 1] = angle * wave
    dq, ddq = (torch.from_numpy(np.gradient(q[0].numpy(), time.numpy(), axis=0))[None] for _ in range(2))
    return FAMILY.roll_out(torch.zeros(1, 2, 3, 2, dtype=torch.float64), time)._replace(
        position=q, velocity=dq, acceleration=ddq
    )


def test_collisions_and_the_floor_are_found(tmp_path):
    path = written(tmp_path / "1.csv", folded(2.85))
    found = check_file(Robot(FILE, ["shoulder", "elbow"], Facts()), path)
    assert not found["valid"] and found["colliding"] > 5 and found["pair"] == "base – forearm"
    spared = check_file(Robot(FILE, ["shoulder", "elbow"], Facts(exempt=[["forearm", "base"]])), path)
    assert "base – upper_arm" in spared["pair"]  # neighbours, which facts are to name
    every = Facts(exempt=[["forearm", "base"], ["upper_arm", "base"], ["upper_arm", "forearm"]])
    assert check_file(Robot(FILE, ["shoulder", "elbow"], every), path)["colliding"] == 0
    low = check_file(Robot(FILE, ["shoulder", "elbow"], Facts(floor=0.6)), written(path, folded(1.5)))
    assert not low["valid"] and low["height"] < -0.1
    standing = Facts(floor=0.6, standing=["forearm", "upper_arm"])
    assert check_file(Robot(FILE, ["shoulder", "elbow"], standing), path)["height"] == np.inf


def test_a_folder_is_as_bad_as_its_worst_file(motion, tmp_path):
    written(tmp_path / "01.csv", motion)
    written(tmp_path / "02.csv", folded(2.85))
    written(tmp_path / "all.csv", folded(2.85))
    found = check_folder(FILE, tmp_path, Facts(), tell=False)
    assert found["trajectories"] == 2 and found["valid"] == 1 and found["first"] == "base – forearm"


def test_joints_that_are_locked_stand_where_they_are_locked(planar, motion, tmp_path):
    alone = motion._replace(**{k: getattr(motion, k)[..., :1] for k in motion._fields[1:]})
    path = written(tmp_path / "1.csv", alone, ["shoulder"])
    found = check_file(Robot(FILE, ["shoulder"], Facts(locked={"elbow": 1.2})), path)
    whole = [torch.zeros_like(x) for x in motion[1:]]
    for x, one in zip(whole, alone[1:]):
        x[..., :1] = one
    whole[0][..., 1] = 1.2
    torque = RigidBody(planar).torque(*whole)[..., 0]
    assert found["effort"] == pytest.approx(float(torque.abs().max() / planar.torque_limit[0]))


def test_remedies_are_followed_until_there_are_none():
    said = [
        RobotError("joint a has no limit: 'robot.limits.velocity={a: 2}' sets it"),
        InfeasibleError("links touch: 'robot.may_touch=[[a, b]]' leaves them unchecked"),
    ]
    asked = []

    def work(words):
        asked.append(words)
        if len(asked) <= len(said):
            raise said[len(asked) - 1]
        return "done"

    assert remedied(work) == ("done", ["robot.limits.velocity={a: 2}", "robot.may_touch=[[a, b]]"])
    del asked[:]
    given, velocity = ["robot.base=torso"], "robot.limits.velocity={a: 2}"
    assert remedied(work, given) == ("done", [*given, velocity, "robot.may_touch=[[a, b]]"])
    with pytest.raises(RobotError, match="hopeless"):
        remedied(lambda words: (_ for _ in ()).throw(RobotError("hopeless")))


def test_of_ends_that_exclude_each_other_the_first_is_taken():
    words = followed("which arm: robot.tip=left, robot.tip=right or robot.base=torso", {})
    assert words == {"robot.tip": "left"}


def test_what_is_done_is_kept_and_the_page_says_what_is_refused(tmp_path, monkeypatch, capsys):
    calls = []
    check = {"valid": 35, "trajectories": 35, "velocity": 0.98, "effort": 0.5, "acceleration": 0, "jerk": 0.4}
    loaded = {"words": ["robot.tip=hand"], "joints": 6, "told": ["one"], "checked": "much", "floor": ""}
    made = {"seconds": 60.0, "cpu": 12.3, "condition": 45.6, "command": ""}
    shapes = {"refused": 0.001, "missed": 0.0}
    monkeypatch.setattr(arms, "robot_file", lambda name, folder: Path(name))
    monkeypatch.setattr(arms, "_load", lambda file, given: calls.append("load") or loaded)
    monkeypatch.setattr(arms, "_compare", lambda *a: calls.append("compare") or shapes)
    monkeypatch.setattr(arms, "_rate", lambda *a: {"random": 2345.6, "set": 345.6})
    monkeypatch.setattr(arms, "_check", lambda *a: calls.append("check") or check)

    def excite(file, *rest):
        calls.append(f"excite {file}")
        if str(file) == "z1" and calls.count("excite z1") == 1:
            raise InfeasibleError("no seed became valid")
        return made

    monkeypatch.setattr(arms, "_excite", excite)
    words = ["--arms", "panda", "z1", "--work", str(tmp_path), "--page", str(tmp_path / "arms.md")]
    assert arms.main(words) == 1
    text = (tmp_path / "arms.md").read_text()
    assert (
        "| panda | 6 | with tip | 0.10% | 0.00% | 12 | 45.6 | 2,346, 346 | 35 of 35 | 98% | 50% | — | 40% |"
        in text
    )
    assert "**z1**: no seed became valid" in text and "robot.tip=hand" in text
    assert arms.main(words) == 0
    assert calls.count("load") == 2 and calls.count("excite panda") == 1 and calls.count("check") == 2
    assert "Refused" not in (tmp_path / "arms.md").read_text()
    assert json.loads((tmp_path / "z1.json").read_text())["set"] == made


def test_every_arm_of_the_table_has_a_file():
    assert len(arms.ARMS) >= 15 and all(one["file"].endswith(".urdf") for one in arms.ARMS.values())


def test_arms_that_were_tried_last_are_looked_for_where_one_says(tmp_path, monkeypatch):
    name = next(name for name, one in arms.ARMS.items() if "wheel" in one)
    for folder in (None, tmp_path):
        with pytest.raises(SideganError, match="--descriptions"):
            arms.robot_file(name, folder)
    file = tmp_path / arms.ARMS[name]["file"]
    file.parent.mkdir(parents=True)
    file.touch()
    assert arms.robot_file(name, tmp_path) == file
    monkeypatch.setattr(arms, "_measure", None)  # without a folder they are left out
    words = ["--arms", name, "--work", str(tmp_path / "work"), "--page", str(tmp_path / "arms.md")]
    assert arms.main(words) == 0


def test_neighbours_count_as_the_others_where_none_is_exempt(planar):
    """No exemption is not the same as nothing said, by which neighbours may touch."""
    constraints = SimpleNamespace(exempt=(), regions=(), excepted={})
    cfg = SimpleNamespace(robot=SimpleNamespace(limits=Limits()))
    task = SimpleNamespace(arm=planar, constraints=constraints, cfg=cfg)
    assert arms.facts_of(task).exempt == []
