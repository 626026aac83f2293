"""Executed motions as files of recordings."""

from collections.abc import Sequence
from pathlib import Path

from sidegan.base.storage import replacing, write_parquet
from sidegan.errors import ConfigError
from sidegan.plant.execute import Executed

_LETTERS = {"position": "q", "velocity": "dq", "torque": "tau"}


def save_recording(executed: Executed, joint_names: Sequence[str], path: Path) -> None:
    """Write a recording as CSV or Parquet: ``time`` [s], then ``q_<joint>``, ``dq_``, ``tau_`` in SI units.

    Args:
        executed: what to write.
        joint_names: of the arm, (J,).
        path: ending in .csv or .parquet.

    Raises:
        ConfigError: when the path ends otherwise.
        StorageError: when the file cannot be written.
    """
    columns = {"time": executed.time.numpy()}
    for signal, letter in _LETTERS.items():
        values = getattr(executed, signal).numpy()
        columns |= {f"{letter}_{name}": values[:, i] for i, name in enumerate(joint_names)}
    if path.suffix == ".parquet":
        import pyarrow as pa

        write_parquet(path, pa.table(columns))
    elif path.suffix == ".csv":
        import pandas as pd

        with replacing(path) as draft:
            pd.DataFrame(columns).to_csv(draft, index=False, float_format="%.17g")
    else:
        raise ConfigError(f"{path} ends in {path.suffix!r}, expected .csv or .parquet")
