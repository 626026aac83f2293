"""Made-up recordings with known parameters."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np

from sidegan.identification import (
    FULL,
    EstimationSettings,
    Measurements,
    Noise,
    Terms,
    TorqueModel,
    estimate,
    score,
)
from sidegan.identification.effects import Effects
from sidegan.identification.settings import GoalSettings, StudySettings
from sidegan.identification.verdict import Quality
from sidegan.identification.workflow import assess, identify_arm
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.check import check_recording
from tests.recording.conftest import COULOMB, VISCOUS, moved, of_file

NOISE = Noise()
GOAL = GoalSettings(count=1, objective="parameters")
FRICTION = {"rotor_inertia": 0.2, "viscous": 1.5, "coulomb": 2.0, "offset": 0.3}


def multisine(joints, samples, seed=0, rate=100.0, sines=4):
    """Position, velocity and acceleration, (S, J) each, of sums of sines that no two joints share."""
    random = np.random.default_rng(seed)
    time = np.arange(samples)[:, None, None] / rate
    speed = random.uniform(0.5, 4.0, (sines, joints))
    size = random.uniform(0.2, 0.6, (sines, joints))
    angle = time * speed + random.uniform(0, 2 * np.pi, (sines, joints))
    q, dq, ddq = size * np.sin(angle), size * speed * np.cos(angle), -size * speed**2 * np.sin(angle)
    return q.sum(1), dq.sum(1), ddq.sum(1)


def truth_of(model):
    """Parameters (P,) of the description with friction, another one at every joint."""
    grow = np.linspace(1.0, 0.4, model.joints)
    terms = [FRICTION[name] * grow for name in model.kinds]
    return model.mapping @ np.concatenate([model.arm.inertial_parameters.ravel(), *terms])


def at_once(samples):
    """Within the block, measurements are walked through in pieces of so many samples."""
    return patch("sidegan.identification.measurements.SAMPLES_AT_ONCE", samples)


def white(shape, *seed):
    return np.random.default_rng(seed).normal(size=shape)


def measured(model, states, noise=0.0, seed=0, parameters=None):
    """Measurements of the model at states, by its true parameters or others, with white noise [N·m]."""
    torque = model.torque(truth_of(model) if parameters is None else parameters, *states)
    return Measurements(*states, torque + noise * white(torque.shape, seed, 1))


def recorded(model, samples=1500, noise=0.0, seed=0):
    return measured(model, multisine(model.joints, samples, seed), noise, seed)


def planted(model, chosen, size):
    """The model with effects of a size [N·m] on single joints, and its true parameters."""
    load = truth_of(model)[: model.moved]
    rigid = model.regressor(*multisine(model.joints, 1000))[..., : model.moved] @ load
    effects = Effects(sorted(chosen), load, np.sqrt(np.square(rigid).mean(0)))
    true = TorqueModel(model.body, model.terms, effects)
    return true, np.append(truth_of(model), np.full(true.count - model.count, size))


def checked(arm, seed, truth=None, change=None, seconds=15, rate=200, friction=(VISCOUS, COULOMB), **motion):
    """A recording of a true arm, changed, and checked against a description."""
    time = np.arange(seconds * rate) / rate
    made = moved(truth or arm, time, *friction, np.random.default_rng(seed), **motion)
    return check_recording(made if change is None else change(made), arm, of_file())


def identified(arm, training, validation=(), method="weighted", effects="auto", **others):
    terms = Terms(sign_width=0.01, effects=effects)
    options = EstimationSettings(method=method, **others)
    return identify_arm(arm, list(training), list(validation), terms, options)


def half_still(arm, noise, elbow=1e-2):
    """A model of a planar arm, its estimate from a recording in which the elbow hardly moves, and that."""
    model = model_of(arm)
    data = measured(model, [x * np.array([1.0, elbow]) for x in multisine(2, 1000)], noise)
    return model, estimate("weighted", model, data), data


def judged(model, found, data, validation=None):
    """Quality of an estimate from data, on measurements that were held out, where nothing is noise."""
    train = score(model, found.parameters, data)
    tested = None if validation is None else score(model, found.parameters, validation)
    given = {"train": train, "held_out": tested, "where": "validation data", "folds": None}
    given |= {"noise": np.zeros(model.joints, dtype=bool), **assess(model, found, validation or [data])}
    return Quality(arm=model.arm, estimate=found, **given)


class Fixed:
    """A linear model whose regressor (S, J, P) is known beforehand; the first position is the sample."""

    effects = None

    def __init__(self, y):
        self.y, self.joints, self.count = y, y.shape[1], y.shape[2]
        self.names, self.kinds = [f"p{i + 1}" for i in range(self.count)], ("all",)

    def regressor(self, q, dq, ddq, sign=None):
        return self.y[q[:, 0]]

    def measurements(self, torque):
        rows, none = np.broadcast_to(np.arange(len(torque))[:, None], torque.shape), np.zeros_like(torque)
        return Measurements(rows, none, none, torque)


def noisy_rows(samples):
    """Regressor (S, 3, 6) with columns of unlike sizes and torque (S, 3) with noise of unlike sizes."""
    random = np.random.default_rng(3)
    y = random.normal(size=(samples, 3, 6)) * [30, 1, 0.1, 3, 0.02, 1]
    tau = y @ random.normal(size=6) + random.normal(size=(samples, 3)) * [1, 0.3, 0.05]
    return y, tau


def model_of(arm, **terms):
    return TorqueModel(RigidBody(arm), replace(FULL, **terms))


def study_settings(**changes):
    return StudySettings(**{"rate": 20.0, "repeats": 2, "tests": 3, "reach": 0.5, **changes})


def assert_close(one, other, tolerance=1e-9):
    """Relative to the largest entry, as a norm."""
    other = np.asarray(other)
    assert np.abs(np.asarray(one) - other).max() <= tolerance * np.abs(other).max()
