"""Arms as people have them: what is decided for them, and what is told where a set is worth little."""

import logging
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

from sidegan.design import search as searching
from sidegan.design.search import ConditionGoal, design_set, search
from sidegan.pipeline.run import run_stages
from sidegan.steps.trajectories import TrajectorySet
from sidegan.validity.remedies import remedy
from tests.oracle import chain_model, pinocchio_torque
from tests.robot.arms import task_of
from tests.robot.test_cases import LIMIT, arm_of, inertial, rod
from tests.robot.urdf import ball

POST = rod('xyz="0 0 0.02"') + ball(0.05, "0.2 0 0.4")  # of the base, beside the second joint
HUB = inertial() + rod() + ball(0.14)  # that turns in that joint, 1 cm from the post wherever it is
GAP = arm_of({1: HUB}, base=POST)
PIN, RING = inertial() + ball(0.06, "0.1 0 0.3"), inertial() + rod() + ball(0.05, "0.02 0 -0.3")
TOUCHING = arm_of({1: PIN, 3: RING})
WEAK = arm_of(limit=LIMIT.replace('effort="50"', 'effort="8"'))
DENSE = arm_of({1: inertial(moments=(1, 1, 0.01)) + rod()})
LIGHT = arm_of({1: inertial(mass=0.002, moments=(2e-5, 2e-5, 4e-6)) + rod()})
FAST = arm_of(limit=LIMIT.replace('velocity="2"', 'velocity="25"'))
STICKY = arm_of(limit=LIMIT + '<dynamics damping="20" friction="15"/>')
FRICTION = arm_of(limit=LIMIT + '<dynamics damping="6" friction="5"/>')
ALIKE = arm_of(dict.fromkeys(range(4), inertial(place="0 0 0") + rod()))
STATE = '<group_state name="{}" group="arm">{}</group_state>'
KEY = '<key name="{}" qpos="0.3 0.6 -1.2 0.2"/>'
HOME = (0.3, 0.6, -1.2, 0.2)


@pytest.fixture
def excited(tmp_path):
    """The excitation of an arm of this text; other files beside it, by name."""

    def made(text, *words, **beside):
        for name, content in beside.items():
            (tmp_path / name.replace("_", ".")).write_text(content)
        (tmp_path / "arm.urdf").write_text(text)
        return task_of(tmp_path / "arm.urdf", words, tmp_path / "out")

    return made


def found_for(context):
    """One trajectory of a set."""
    return search(context.cell.problem, ConditionGoal(context.cell.problem).next(), context.cfg.search)


def test_links_with_a_constant_gap_keep_part_of_it(excited):
    context = excited(GAP)
    constraints = context.cell.constraints
    assert constraints.tight == {("base", "link1"): 0.006} and constraints.apart == 0.02
    assert "0.02 m (less room: base – link1 0.006 m)" in constraints.kept_clear
    found = found_for(context)
    assert found.share == 1 and np.median(context.cell.problem.limit_use(found.coefficients[None])) > 0.7


def test_an_automatic_home_has_room_beyond_the_clearance(excited):
    beside = arm_of(base=rod('xyz="0 0 0.02"') + ball(0.05, "0.112 0 1.15"))  # 22 mm from link 3 at zeros
    cell = excited(beside).cell
    assert any(cell.home) and not any(excited(beside, "workspace.clearance=0.02").cell.home)
    q = np.array(cell.home, float)
    assert cell.constraints.distances_at(q)["base", "link3"] >= 0.03 and not cell.constraints.tight


@pytest.mark.parametrize(
    ("where", "said"),
    [
        (
            ("collision", "base – link1"),
            "a clearance below 0.006 m (workspace.clearance=…), another home",
        ),
        (("collision", "base – link1"), "'robot.may_touch=[[base, link1]]'"),
        (("keep_out", "link3 in region 0"), "workspace=free"),
        (("torque", "joint1"), "masses that are right (8 kg together, link0 2 kg), another home"),
        (("torque", "joint1"), "if the same limit for all joints is a placeholder, state the real ones"),
        (("velocity", "joint2"), "slower motion (trajectory.period=…), more of the limits (robot.effort=…"),
        (("position", "joint3"), "another home ('trajectory.home=[…]')"),
    ],
)
def test_every_constraint_has_a_suggested_setting(excited, where, said):
    assert said in remedy(excited(GAP).cell.constraints, where)


@pytest.mark.parametrize("kind", ["position", "velocity", "effort", "acceleration"])
def test_no_remedy_raises_a_limit_that_the_description_states(excited, kind):
    several = GAP.replace('effort="50"', 'effort="60"', 1)
    value = "[-1, 1]" if kind == "position" else "2"
    where = "torque" if kind == "effort" else kind, "joint2"
    for words, raised in ([], False), ([f"robot.limits.{kind}={{joint2: {value}}}"], True):
        said = remedy(excited(several, *words).cell.constraints, where)
        assert ("'robot.limits." in said) == raised and ("wider limit than yours" in said) == raised


def test_the_limiting_constraint_of_a_weak_set_is_reported(excited):
    context = excited(GAP, "robot.limits.velocity={joint0: 0.2, joint1: 0.2, joint2: 0.2, joint3: 0.2}")
    c = found_for(context).coefficients[None]
    weak, good = (TrajectorySet.of(context.cell, x) for x in (0.05 * c, c))
    vars(weak)["condition"], vars(good)["condition"] = 1e7, 100.0
    (said,) = weak.warnings
    assert "it uses 5% of the limits on motion, its condition number is 1e7; it is limited by " in said
    assert re.search(r"velocity of joint\d: .*'robot.limits.velocity={joint0: (0.2|…), ", said)
    assert good.warnings == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            TOUCHING,
            r"in most configurations: link1 – link3 in \d\d%; .*'robot.may_touch=\[\[link1, link3\]\]'",
        ),
        (WEAK, r"joint1 \(effort 8\) in \d\d%, .*check the masses .*'robot.limits.effort={joint1: …"),
        (DENSE, r"link1 \(radius of gyration 0.709 m in a link of 0.16 m\).* joint1 may differ"),
        (LIGHT, r"link1 \(0.002 kg in a link of 0.16 m, where 2 kg is usual\)"),
        (FAST, r"velocity of joint0, .* \(up to 25\); are they the motors'.*limits.velocity={joint0: …"),
        (STICKY, r"friction of joint0, joint1, .* exceeds the torque limit.*robot.friction=false"),
        (ALIKE, r"masses of link0, link1, link2, link3 are placeholders .* mean nothing until"),
    ],
    ids=["touching", "weak", "dense", "light", "fast", "sticky", "alike"],
)
def test_description_problems_are_reported_before_the_design(excited, caplog, text, said):
    excited(text).log_decisions()
    assert re.search(said, caplog.text)
    caplog.clear()
    excited(arm_of()).log_decisions()
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_trajectories_that_hardly_move_are_retried_then_dropped(excited, monkeypatch, caplog):
    context, calls = excited(GAP, "search.evaluations=60"), []

    def spoiled(bad, problem, goal, settings, seed):
        calls.append(seed)
        found = search(problem, goal, settings, seed)
        return replace(found, share=0.02) if seed in bad else found

    problem = context.cell.problem
    for bad, count in (({0}, 2), ({1, 3, 5, 7}, 1)):
        monkeypatch.setattr(searching, "search", partial(spoiled, bad))
        assert len(design_set(problem, ConditionGoal(problem), 2, context.cfg.search, 0)) == count
        assert calls[:3] == [0, 2, 1]
    assert "1 of 2 trajectories hardly move the arm and are left out, limited by position of " in caplog.text


def test_reported_torques_include_friction_and_keep_the_limits(excited, tmp_path):
    """By Pinocchio, damping times the velocity and friction by its sign."""
    context = excited(FRICTION, "goal.count=2", "controllers.rate=500")
    run_stages(context.cfg, tmp_path / "run", "excite")
    told = pd.read_csv(tmp_path / "run" / "set.csv")["peak torque"]
    model, shares = chain_model(context.cell.whole_arm), []
    for k in (1, 2):
        frame = pd.read_csv(tmp_path / "run" / "trajectories" / f"{k}.csv")
        q, dq, ddq = (frame.filter(regex=rf"^{kind}_").to_numpy() for kind in ("q", "dq", "ddq"))
        torque = pinocchio_torque(model, q, dq, ddq) + 6 * dq + 5 * np.sign(dq)
        shares.append((np.abs(torque) / 50).max())
    assert max(shares) <= 0.8 and [f"{x:.0%}" for x in shares] == [x.split(",")[0] for x in told]


def postures(*names, value=0.3):
    """An SRDF with the same state by each name."""
    joints = "".join(f'<joint name="joint{k}" value="{q}"/>' for k, q in enumerate([value, *HOME[1:]]))
    return f'<robot name="rods">{"".join(STATE.format(name, joints) for name in names)}</robot>'


@pytest.mark.parametrize(
    ("kind", "names", "value", "home"),
    [
        ("revolute", ["folded"], 0.3, HOME),
        ("revolute", ["folded", "Home"], 0.3, HOME),
        ("revolute", ["folded", "up"], 0.3, None),
        ("revolute", ["home"], 2.8, None),  # at the end of the joint's range
        ("continuous", ["home"], 4.0, (4.0, *HOME[1:])),
    ],
)
def test_home_is_read_from_an_srdf(excited, caplog, kind, names, value, home):
    text = arm_of().replace("revolute", kind)
    context = excited(text, arm_srdf=postures(*names, value=value))
    assert context.cell.home == (home or (0,) * len(HOME))
    with caplog.at_level(logging.INFO):
        context.log_decisions()
    decided = f"home is that of the description: {value:g}, 0.6"
    assert (decided in caplog.text) == (home is not None)
    assert excited(text, arm_srdf=postures("home").replace("rods", "other")).cell.home == (0,) * len(HOME)


def test_home_is_read_from_an_mjcf_keyframe(tmp_path):
    body = '<body name="b{0}" pos="0 0 0.3"><joint name="j{0}" axis="0 1 0" range="-160 160"/>'
    body += '<geom type="capsule" size="0.04" fromto="0 0 0.06 0 0 0.24"/>'
    bodies = "".join(map(body.format, range(4))) + 4 * "</body>"
    keys = f"<keyframe>{KEY.format('home')}{KEY.format('other').replace('0.3', '0')}</keyframe>"
    (tmp_path / "arm.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody>{keys}</mujoco>")
    speeds = "robot.limits.velocity={j0: 2, j1: 2, j2: 2, j3: 2}"
    assert task_of(tmp_path / "arm.xml", [speeds], tmp_path / "out").cell.home == HOME
