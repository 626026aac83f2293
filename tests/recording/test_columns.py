"""Columns are recognised by names and units in all usual conventions; what is odd about them is reported."""

from contextvars import Context
from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import RecordingError
from sidegan.recording.units import Units
from tests.recording.conftest import check, recorded
from tests.recording.files import JOINTS, assert_same, columns_of, named, read, table
from tests.refusals import refused

NAMES = [  # of time, positions and torques; {i} counts from 0, {n} from 1
    *(("t", "q{i}", "tau{i}"), ("Time", "Q{n}", "TAU{n}"), ("time [s]", "q_{i}", "tau_{i}")),
    *(("timestamp", "joint_{i}_pos", "joint_{i}_torque"), ("t", "actual_q_{i}", "motor_torque_{i}")),
    *(("t", "- {j}_position", "- {j}_effort"), (" t", " q0{n}", " tau0{n}"), ("t", "{j}.pos", "effort.{j}")),
    *(("state.time", "state.q[{i}]", "state.tau_J[{i}]"), ("%time", "field.pos{i}", "field.eff{i}")),
    *(("__time", "/states/{j}/position", "/states/{j}/effort"), ("t", "current_pos_{i}", "motorTrq{i}")),
    *(("time", ".position.{i}", ".effort.{i}"), ("timestamp", "observation.state.{j}.pos", "{j}.effort")),
]
FOREIGN = """q_d[{i}] tau_J_d[{i}] tau_ext_hat_filtered[{i}] target_q_{i} tau_dot_{n} O_T_EE[{i}] theta[{i}]
action.{j}.pos finger_joint{n}_position actual_TCP_speed_{i}"""


@pytest.mark.parametrize("names", NAMES)
def test_columns_are_recognised_by_name(made, tmp_path, names):
    foreign = {c: 1.0 for pattern in FOREIGN.split() for c in columns_of(pattern)}
    found = read(tmp_path, named(made, *names, **foreign))
    assert_same(found, made)
    assert found.velocity is None and found.current is None and not found.remarks


def test_joints_follow_the_order_named_in_the_file(made, tmp_path):
    table = named(made, "Time", "position_{i}", "effort_{i}", name_0="elbow", name_1="shoulder")
    np.testing.assert_allclose(read(tmp_path, table).torque, made.torque[:, [1, 0]])


def test_of_two_arms_the_one_with_the_names_is_read(made, tmp_path):
    other = {f"{name}_right_joint_{k}": 9.0 + k for name in ("q", "tau") for k in (1, 2)}
    both = named(made, "t", "q_left_joint_{n}", "tau_left_joint_{n}", **other)
    found = read(tmp_path, both, ("left_joint_1", "left_joint_2"))
    assert_same(found, made)
    assert not found.remarks


LEFT_OVER = [
    ("q{i} tau{i}", "q2 tau2", "'recording.position=\"q{index}\"' 'recording.torque=\"tau{index}\"'"),
    ("q{n} tau{n}", "q3 tau3", "not used: q3, tau3"),
]


@pytest.mark.parametrize(("names", "more", "words"), LEFT_OVER)
def test_unused_columns_are_reported(made, tmp_path, names, more, words):
    found = read(tmp_path, named(made, "t", *names.split(), **dict.fromkeys(more.split(), 1.0)))
    assert_same(found, made)
    assert words in "".join(found.remarks)


def test_the_other_numbering_is_one_argument_in_python(made, tmp_path):
    found = Context().run(read, tmp_path, named(made, "t", "q{i}", "tau{i}", q2=1.0, tau2=1.0))
    assert "recording={'position': 'q{index}', 'torque': 'tau{index}'}" in found.remarks[0]


UNKNOWN = [
    ({"q": "theta{i}"}, "'recording.position=\"theta{index0}\"'"),
    ({"tau": "load{n}"}, "'recording.torque=\"load{index}\"'"),
    ({"q": "{j}x.pos", "tau": "{j}x.tau"}, "'recording.joints=[shoulderx, elbowx]'"),
]


@pytest.mark.parametrize(("names", "setting"), UNKNOWN)
def test_unknown_column_names_are_refused_with_the_setting_to_type(made, tmp_path, names, setting):
    with refused(RecordingError, "a.csv", setting):
        read(tmp_path, named(made, **names))


STATED = [  # a signal, headings of its columns, and the factor to SI units of the unit in them
    ("torque", "tau1 [lbf.ft]; tau1 [ft-lb]; tau1 [lb ft]", 1.3558179483),
    ("torque", "Torque 1 (lbf·in); tau_1_in-lb", 0.1129848290),
    ("torque", "tau1 [oz-in]; tau1 (ozf.in) (filtered)", 0.00706155181423),
    ("torque", "tau1 [N.cm]; tau1_Ncm; tau_Ncm_1; effort[0] (N cm)", 0.01),
    ("torque", "tau1 [kN.m]", 1e3),
    ("torque", "tau1_kgf.cm", 0.0980665),
    ("torque", "tau1 [N*mm]; tau1.N·mm", 1e-3),
    ("torque", "tau1 [Nm] (filtered); tau1 (N·m); tau1 (in); tau1 (MA); tau1 [-]; tau1 [Nm/rad]", 1.0),
    ("torque", "joint_states[0]; effort_lb; tau [left]; tau1 (kg m²); tau (A)", 1.0),
    ("position", "q1 [gon]", np.pi / 200),
    ("position", "q1_mrad; q_mrad_1", 1e-3),
    ("position", "q (rev)", 2 * np.pi),
    ("position", "q1 (measured); position[3]; q (actual); q_min; q [rad]", 1.0),
    ("position", "q_hip_rev; hip_turn.pos; q_wrist_turn", 1.0),
    ("velocity", "qd1 [mrad/s]", 1e-3),
    ("velocity", "qd1 [rev/s]; qd1 [revs/s]", 2 * np.pi),
    ("velocity", "qd1 [rad/s]; qd [rad/s^2]; qd (m); qd_in; qd1 [m/s]", 1.0),
    ("current", "i1 [uA]; i1 [μA]", 1e-6),
    ("current", "current_mA_a", 1e-3),
    ("time", "t [μs]; time_usec", 1e-6),
]


@pytest.mark.parametrize(("signal", "headings", "factor"), STATED)
def test_headings_state_units_and_other_things(signal, headings, factor):
    for heading in headings.split("; "):
        unit, found = Units().of("a.csv", signal, False, heading)
        assert found == pytest.approx(factor, rel=1e-9) and bool(unit) == (factor != 1), heading


def test_a_force_in_volts_is_refused_with_units_of_force():
    with refused(RecordingError, "'V'", "to N and", "kgf", "'recording.units.torque=\"N·m\"'"):
        Units().of("a.csv", "torque", True, "tau1 [V]")


@pytest.mark.parametrize("headings", [("q1", "q2"), ("q1_deg", "q2_mm"), ("J1 Pos (deg)", "J2 Pos (mm)")])
def test_degrees_apply_to_revolute_and_millimetres_to_prismatic_joints(made, tmp_path, headings):
    q = made.position * [180 / np.pi, 1e3]
    units = {"angle": "deg", "length": "mm"} if headings == ("q1", "q2") else {}
    renamed = table(made, **{"q1": None, "q2": None, **dict(zip(headings, q.T))})
    found = read(tmp_path, renamed, sliding=JOINTS[1:], units=units)
    np.testing.assert_allclose(found.position, made.position)


@pytest.mark.parametrize(("unit", "factor", "other"), [("m", 1e3, "mm"), ("mm", 1e-3, "m")])
def test_a_prismatic_joint_in_the_wrong_unit_is_refused(planar, clock, unit, factor, other):
    lower, upper = np.array([[-2.5, -1.6], [2.5, 1.6]])
    slides = np.array([False, True])
    sliding = replace(planar, prismatic=slides, position_lower=lower, position_upper=upper)
    made = recorded(sliding, clock, ("position", "torque"))
    wrong = replace(made, position=made.position * [1.0, factor])
    assert not any("unit" in warning for warning in check(made, sliding).warnings)
    with refused(RecordingError, "elbow", f"(recording.units.length={other})"):
        check(wrong, sliding, units={"length": unit})
