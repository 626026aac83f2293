import os
from pathlib import Path

import numpy as np
import pytest

from sidegan.base.typed import build
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.check import check_recording
from sidegan.recording.recording import Recording
from sidegan.recording.settings import RecordingSettings
from sidegan.robot import load_robot

PLANAR = load_robot("planar2")
VISCOUS, COULOMB = np.array([2.0, 0.8]), np.array([1.0, 0.4])  # friction of a planar arm


@pytest.fixture(autouse=True)
def messages(of_the_command):
    """Messages are those of the command."""


def real(name):
    """A file of the recordings that are not part of the project."""
    beside = Path(__file__).parents[2] / ".." / "shared" / "data"
    path = Path(os.environ.get("SIDEGAN_DATA", beside)) / name
    if not path.exists():
        pytest.skip(f"{name} is not at hand: put it beside the project in shared/data, or set SIDEGAN_DATA")
    return path.resolve()


def of_file(**changes):
    """Settings of recordings with changes."""
    return build(RecordingSettings, changes)


def check(recording, arm=PLANAR, gains=None, **changes):
    """A recording that is checked with changed settings."""
    return check_recording(recording, arm, of_file(**changes), gains)


def states(time, joints=2):
    """A motion of two sines per joint below 0.6 Hz: position, velocity, acceleration, (S, J) each."""
    t = np.asarray(time)[:, None]
    w1, w2 = 2 * np.pi * (0.2 + 0.05 * np.arange(joints)), 2 * np.pi * (0.47 - 0.06 * np.arange(joints))
    q = 0.8 * np.sin(w1 * t) + 0.4 * np.sin(w2 * t + 1)
    v = 0.8 * w1 * np.cos(w1 * t) + 0.4 * w2 * np.cos(w2 * t + 1)
    a = -0.8 * w1**2 * np.sin(w1 * t) - 0.4 * w2**2 * np.sin(w2 * t + 1)
    return q, v, a


def recorded(arm, time, keep=("position", "velocity", "torque")):
    """A recording of that motion with some friction."""
    q, v, a = states(time, arm.joints)
    torque = RigidBody(arm).torque(q, v, a) + 0.5 * v + 0.3 * np.tanh(v / 0.01)
    signals = {"position": q, "velocity": v, "acceleration": a, "torque": torque, "current": torque / 2}
    return Recording("made", arm.joint_names, np.asarray(time), **{name: signals[name] for name in keep})


def moved(arm, time, viscous, coulomb, generator, harmonics=5, period=10.0, noise=0.02):
    """A random periodic motion of an arm, which begins and ends anywhere, with noisy torque."""
    t = np.asarray(time)[:, None, None]
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    draw = generator.standard_normal((2, arm.joints, harmonics))
    size = 0.4 * np.abs(draw[0]) / np.sqrt(w)
    phase = w * t + 3 * draw[1]
    sine, cosine = size * np.sin(phase), size * np.cos(phase)
    q, v, a = (x.sum(2) for x in (sine, w * cosine, -(w**2) * sine))
    torque = RigidBody(arm).torque(q, v, a) + viscous * v + coulomb * np.tanh(v / 0.03)
    error = noise * torque.std(0) * generator.standard_normal(torque.shape)
    return Recording("made", arm.joint_names, t[:, 0, 0], q, velocity=v, torque=torque + error)


@pytest.fixture(scope="session")
def clock():
    """20 s at about 100 Hz, with a tenth of a step of jitter."""
    rng = np.random.default_rng(1)
    return np.arange(2000) * 0.01 + rng.uniform(-0.001, 0.001, 2000)


@pytest.fixture(scope="session")
def recording(planar, clock):
    return recorded(planar, clock)


@pytest.fixture(scope="session")
def made(recording):
    """Its first 200 samples."""
    return recording.take(slice(200))
