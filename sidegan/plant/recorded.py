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
    from scipy.signal import butter, lfilter, sosfiltfilt  # slow to import

    rate = plant.settings.rate
    clock = np.arange(round(family.period * rate)) / rate
    sos = butter(2, sensors.cutoff, fs=rate, output="sos")
    position, torque = plant.follow(family.roll_out(coefficients, clock))
    q = sosfiltfilt(sos, position, axis=1)  # without phase shift
    torque = sosfiltfilt(sos, torque, axis=1)
    dq = np.gradient(q, 1 / rate, axis=1)
    ddq = np.empty_like(q)
    ddq[:, 1:-1] = (q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]) * rate**2
    ddq[:, 0], ddq[:, -1] = ddq[:, 1], ddq[:, -2]
    step = round(rate / sensors.rate)
    states = [np.ascontiguousarray(x[:, step // 2 :: step]) for x in (q, dq, ddq, torque)]
    if random is not None:
        keep = np.exp(-1 / (sensors.rate * sensors.correlation))
        noise = random.standard_normal(states[3].shape)
        noise[:, 1:] *= np.sqrt(1 - keep**2)  # the filter below leaves all with the same variance
        states[3] += sensors.noise * plant.range * lfilter([1.0], [1.0, -keep], noise, axis=1)
    return states
