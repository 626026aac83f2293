"""What the plant does follows the equations of motion; what it records, the sensors' settings."""

from dataclasses import replace

import pytest
import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import concatenate
from sidegan.plant import IDEAL, Plant
from sidegan.robot import built_in_robots, load_robot

RATE = 1000.0  # Hz


def accelerations(executed):
    return executed.velocity.diff(dim=0) * RATE


def rigid(arm, executed):
    """The torque that accelerated the links, (T − 1, J)."""
    states = executed.position[:-1], executed.velocity[:-1], accelerations(executed)
    return RigidBody(arm).torque(*states)


def rms(x):
    return x.square().mean().sqrt()


@pytest.mark.parametrize("name", built_in_robots())
def test_without_friction_the_torque_is_the_rigid_bodys(name, motions):
    arm = load_robot(name)
    executed = Plant(arm, IDEAL).execute(motions(arm), 0)
    torch.testing.assert_close(executed.torque[:-1], rigid(arm, executed), rtol=0, atol=1e-8)


@pytest.mark.parametrize("joints", [1, 4, 7])
def test_any_chain_obeys_its_equations_of_motion(chain, motions, joints):
    arm = replace(chain(joints, 1), torque_limit=torch.full((joints,), torch.inf))
    settings = replace(IDEAL, viscous=[1.5], rotor_inertia=[0.3])
    executed = Plant(arm, settings).execute(motions(arm), 0)
    wanted = rigid(arm, executed) + 0.3 * accelerations(executed) + 1.5 * executed.velocity[1:]
    torch.testing.assert_close(executed.torque[:-1], wanted, rtol=0, atol=1e-8)


def test_a_drive_at_its_limit_obeys_the_equations_of_motion_too(planar, motions):
    motion = motions(planar)
    most = Plant(planar, IDEAL).execute(motion, 0).torque.abs().amax(0)
    weak = replace(planar, torque_limit=0.97 * most)
    executed = Plant(weak, replace(IDEAL, tolerance=1.0)).execute(motion, 0)
    assert ((executed.torque.abs() >= 0.97 * most).sum(0) > 10).all()
    assert (executed.torque.abs().amax(0) < 0.975 * most).all()
    torch.testing.assert_close(executed.torque[:-1], rigid(weak, executed), rtol=0, atol=1e-8)


def test_coulomb_friction_is_constant_and_against_the_motion(arm, motions):
    coulomb = torch.linspace(0.3, 5.0, 7, dtype=torch.float64)
    settings = replace(IDEAL, coulomb=coulomb.tolist(), rotor_inertia=[0.5])
    executed = Plant(arm, settings).execute(motions(arm), 0)
    friction = executed.torque[:-1] - rigid(arm, executed) - 0.5 * accelerations(executed)
    speed = executed.velocity[1:]
    assert (friction.abs() <= coulomb + 1e-6).all()
    for j in range(7):
        moving = speed[:, j].abs() > 0.05
        assert moving.any()
        sign = speed[moving, j].sign()
        torch.testing.assert_close(friction[moving, j], sign * coulomb[j], rtol=0.01, atol=0)


def test_the_less_a_controller_knows_the_worse_it_tracks(arm, motions, standard):
    motion = motions(arm, period=8.0)
    known = [replace(IDEAL, feed_forward=share) for share in (1.0, 0.9, 0.5)]
    exact, less, least, usual = (
        Plant(arm, one).execute(motion, 0).position - motion.position[0] for one in (*known, standard)
    )
    assert exact.abs().max() < 1e-4 < rms(usual) < 1e-2
    assert rms(exact) < rms(less) < rms(least)


def test_motions_are_executed_one_after_another(planar, motions, standard):
    several = motions(planar, count=3, period=2.0)
    plant = Plant(planar, standard)
    executed = plant.execute(several, 3)
    once = plant.execute(concatenate(several), 3)
    assert executed.time.shape == (6001,)
    torch.testing.assert_close(executed.time.diff(), torch.full((6000,), 1e-3, dtype=torch.float64))
    for mine, theirs in zip(executed, once):
        assert torch.equal(mine, theirs)


def test_positions_are_whole_counts(planar, motions):
    settings = replace(IDEAL, encoder_resolution=[1e-3, 0.0])
    executed, true = (Plant(planar, one).execute(motions(planar), 0) for one in (settings, IDEAL))
    counts = executed.position[:, 0] / 1e-3
    torch.testing.assert_close(counts, counts.round(), rtol=0, atol=1e-9)
    assert (executed.position - true.position).abs().amax(0)[0] <= 0.5e-3 + 1e-12
    assert torch.equal(executed.position[:, 1], true.position[:, 1])
    assert torch.equal(executed.velocity[:, 1], true.velocity[:, 1])
    assert (executed.velocity - true.velocity)[:, 0].abs().max() <= 0.5 + 1e-3  # half a count per ms


def test_torques_have_the_stated_noise_and_bias(planar, motions):
    settings, motion = (
        replace(IDEAL, torque_noise=[0.5, 2.0], torque_bias=[-3.0, 0.25]),
        motions(planar, period=16.0),
    )
    executed, true = (Plant(planar, one).execute(motion, 0) for one in (settings, IDEAL))
    noise = executed.torque - true.torque
    assert torch.equal(executed.position, true.position)
    assert noise.mean(0).tolist() == pytest.approx([-3.0, 0.25], abs=0.06)  # 4σ of 16,001 samples
    assert noise.std(0).tolist() == pytest.approx([0.5, 2.0], rel=0.03)


def test_a_seed_is_a_recording(planar, motions, standard):
    one, same, other = (Plant(planar, standard).execute(motions(planar), seed).torque for seed in (1, 1, 2))
    assert torch.equal(one, same) and not torch.equal(one, other)
