"""Executed motions as files of recordings."""

from collections.abc import Sequence
from pathlib import Path

from sidegan.base.storage import write_parquet
from sidegan.plant.execute import Executed

_LETTERS = {"position": "q", "velocity": "dq", "torque": "tau"}


def save_recording(executed: Executed, joint_names: Sequence[str], path: Path) -> None:
    """Write a recording as Parquet: ``time`` [s], then ``q_<joint>``, ``dq_``, ``tau_`` in SI units.

    Raises:
        StorageError: when the file cannot be written.
    """
    import pyarrow as pa

    columns = {"time": executed.time}
    for signal, letter in _LETTERS.items():
        values = getattr(executed, signal)
        columns |= {f"{letter}_{name}": values[:, i] for i, name in enumerate(joint_names)}
    write_parquet(path, pa.table(columns))
