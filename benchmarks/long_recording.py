"""The command ``python -m benchmarks.long_recording``: an hour at 1 kHz from a file to a validated model."""

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot

PERIOD = 16.0  # [s]
RATE = 1000  # [Hz]
NOISE = {"q": 1e-5, "qd": 1e-3, "tau": 0.1}  # standard deviations
SECONDS, GIGABYTES = 120, 2.0  # what an hour may take


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 1 when it takes more than it may."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.long_recording", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0, help="of the recording (default 60)")
    chosen = parser.parse_args(arguments)
    with TemporaryDirectory() as folder:
        path = Path(folder, "long.parquet")
        samples = write(path, chosen.minutes)
        command = [
            "+experiment=identify",
            f"recordings=[{path}]",
            f"outputs={folder}/outputs",
            "tracking=off",
        ]
        began = time.monotonic()
        done = subprocess.run([sys.executable, "-m", "sidegan.run", *command], capture_output=True, text=True)
        seconds = time.monotonic() - began
    if done.returncode:
        sys.stderr.write(done.stderr)
        return done.returncode
    gigabytes = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    sys.stdout.write(f"{samples} samples of 7 joints: {seconds:.0f} s, at most {gigabytes:.2f} GB\n")
    share = max(chosen.minutes / 60, 0.5)  # starting up takes its time, whatever there is to read
    return int(seconds > share * SECONDS or gigabytes > GIGABYTES)


def write(path: Path, minutes: float) -> int:
    """Write a recording of the LWR, period after period with fresh noise; its number of samples."""
    arm = load_robot("kuka_lwr4")
    family = Trajectory(arm.joints, 6, PERIOD)
    random = torch.Generator().manual_seed(0)
    c = 0.06 * torch.randn(1, arm.joints, 6, 2, generator=random, dtype=torch.float64)
    clock = np.arange(int(PERIOD * RATE)) / RATE
    motion = family.roll_out(c, torch.from_numpy(clock))
    q, v, a = (x[0] for x in motion[1:])
    torque = RigidBody(arm).torque(q, v, a) + 2 * v + torch.tanh(v / 0.03)
    periods, noise = max(1, round(minutes * 60 / PERIOD)), np.random.default_rng(0)
    signals = {"q": q.numpy(), "qd": v.numpy(), "tau": torque.numpy()}
    writer: pq.ParquetWriter | None = None
    for k in range(periods):
        columns = {"t": clock + k * PERIOD}
        for name, x in signals.items():
            noisy = x + NOISE[name] * noise.standard_normal(x.shape)
            columns |= {f"{name}{j + 1}": noisy[:, j] for j in range(arm.joints)}
        table = pa.table(columns)
        writer = writer or pq.ParquetWriter(path, table.schema)
        writer.write_table(table)
    if writer is not None:
        writer.close()
    return periods * len(clock)


if __name__ == "__main__":
    sys.exit(main())
