"""What is refused, and the words that say why."""

from dataclasses import replace

import pytest
import torch

from sidegan.errors import ConfigError, InfeasibleError, RobotError, ShapeError, StorageError
from sidegan.plant import IDEAL, Plant, mujoco_model, save_recording


def weak(arm):
    return replace(arm, torque_limit=torch.tensor([200.0, 1.0], dtype=torch.float64))


def links(arm, *changes):
    """The arm with link parameters changed: link, parameter and factor."""
    parameters = arm.inertial_parameters.clone()
    for link, parameter, factor in changes:
        parameters[link, parameter] *= factor
    return replace(arm, inertial_parameters=parameters)


def not_finite(motion):
    motion.velocity[0, 5, 1] = torch.nan
    return motion


def execute(make=lambda arm: arm, change=lambda motion: motion, rate=1000.0, **settings):
    return lambda arm, motions: Plant(make(arm), replace(IDEAL, **settings)).execute(
        change(motions(arm, rate=rate)), 0
    )


EXECUTED = [
    (InfeasibleError, r"'elbow' does not follow: after 0\.\d+ s .* 0.1 rad .* limit of 1 N·m", execute(weak)),
    (
        InfeasibleError,
        "0.01 rad off its reference$",
        execute(bandwidth=[0.2], feed_forward=0.0, tolerance=0.01),
    ),
    (InfeasibleError, "does not follow", execute(bandwidth=[800.0], damping_ratio=[0.05])),
    (
        RobotError,
        "'upper_arm': .* too far out for its inertia",
        execute(lambda arm: links(arm, (0, slice(4, 10), 0.1))),
    ),
    (ShapeError, r"0\.01 s, expected 0\.001 s: the plant runs at 1000 Hz", execute(rate=100.0)),
    (ShapeError, "velocity of the motion is not finite", execute(change=not_finite)),
    (
        RobotError,
        "MuJoCo refuses planar2",
        execute(lambda arm: links(arm, (slice(None), slice(None), 1e-17))),
    ),
    *(
        (
            ConfigError,
            rf"plant.{name} has 3 values, expected 2 \(one per joint\) or one",
            execute(**{name: [0.1] * 3}),
        )
        for name in ("viscous", "coulomb", "rotor_inertia", "bandwidth", "torque_bias")
    ),
]


@pytest.mark.parametrize(("error", "words", "use"), EXECUTED)
def test_executed(planar, motions, error, words, use):
    with pytest.raises(error, match=words):
        use(planar, motions)


def test_a_motion_of_another_arm(arm, planar, motions):
    with pytest.raises(ShapeError, match=r"position is \(1, 4001, 2\), expected \(B, 4001, 7\)"):
        Plant(arm, IDEAL).execute(motions(planar), 0)


def test_every_link_that_cannot_exist_is_named(arm):
    with pytest.raises(RobotError, match=r"link 'link_2': its mass is 0 kg.*link 'link_5': its mass is -"):
        mujoco_model(links(arm, (1, 0, 0.0), (4, 0, -1.0)))


@pytest.mark.parametrize(("error", "path"), [(ConfigError, "a.xlsx"), (StorageError, "file/a.csv")])
def test_saved(planar, motions, tmp_path, error, path):
    executed = Plant(planar, IDEAL).execute(motions(planar, period=1.0), 0)
    (tmp_path / "file").write_text("")
    with pytest.raises(error, match=r"ends in '.xlsx', expected .csv or .parquet|cannot write"):
        save_recording(executed, ("a", "b"), tmp_path / path)
    assert [one.name for one in tmp_path.iterdir()] == ["file"]
