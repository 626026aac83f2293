"""Recordings of randomised plants, with sensors, filters and coloured noise."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import Hertz, NonNegative, Seconds
from sidegan.motion.trajectory import Trajectory
from sidegan.plant.varied import VariedPlant


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Torque noise relative to each sensor's range, and signal processing."""

    noise: NonNegative = 3e-4  # standard deviation
    correlation: Seconds = 0.03  # correlation time of the noise
    cutoff: Hertz = 10.0  # of the zero-phase low-pass on positions and torques
    rate: Hertz = 50.0  # sampling rate for identification


def recorded(
    plant: VariedPlant,
    family: Trajectory,
    coefficients: Array,
    sensors: Sensors,
    random: np.random.Generator | None = None,
) -> list[Array]:
    """Recorded positions, velocities, accelerations and torques of trajectories, (n, S, J) each.

    Coefficients are (n, J, H, 2) [rad/s]; torques have noise if ``random`` is given.
    """
    rate = plant.settings.rate
    clock = np.arange(round(family.period * rate)) / rate
    signals = plant.follow(family.roll_out(coefficients, clock))
    states = _filtered(*signals, rate, sensors)
    if random is not None:
        states[3] = states[3] + np.stack([_noise(x, plant.range, sensors, random) for x in states[3]])
    return states


def _filtered(position: Array, torque: Array, rate: float, sensors: Sensors) -> list[Array]:
    """States and torque (n, S, J) at the sensors' rate, filtered without phase shift."""
    from scipy.signal import butter, sosfiltfilt  # slow to import

    step = round(rate / sensors.rate)
    sos = butter(2, sensors.cutoff, fs=rate, output="sos")
    q, torque = (sosfiltfilt(sos, x, axis=1) for x in (position, torque))
    dq = np.gradient(q, 1 / rate, axis=1)
    ddq = np.empty_like(q)
    ddq[:, 1:-1] = (q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]) * rate**2
    ddq[:, 0], ddq[:, -1] = ddq[:, 1], ddq[:, -2]
    return [np.ascontiguousarray(x[:, step // 2 :: step]) for x in (q, dq, ddq, torque)]


def _noise(torque: Array, full: Array, sensors: Sensors, random: np.random.Generator) -> Array:
    """Correlated Gaussian noise of a recording's torques, (S, J)."""
    from scipy.signal import lfilter

    keep = np.exp(-1 / (sensors.rate * sensors.correlation))
    draw = random.standard_normal((*torque.shape,))
    draw[1:] *= np.sqrt(1 - keep**2)
    return sensors.noise * full * lfilter([1.0], [1.0, -keep], draw, axis=0)
