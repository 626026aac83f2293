"""Refusal of what a machine's memory cannot hold, before any work."""

import psutil

from sidegan.errors import ConfigError

_NUMBER = 8  # bytes


def require_room(numbers: float, setting: str) -> None:
    """Refuse a setting whose result is so many numbers that this machine's memory cannot hold them.

    Raises:
        ConfigError: says how much it takes, and how much there is.
    """
    needed, there = numbers * _NUMBER, psutil.virtual_memory().total
    if needed > there:
        raise ConfigError(
            f"{setting} takes {needed / 1e9:.3g} GB in memory, this machine has {there / 1e9:.3g} GB"
        )
