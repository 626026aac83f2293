"""The folder in which compiled kernels and fitted shapes are kept for the next run."""

import os
from pathlib import Path

from platformdirs import user_cache_path

_VARIABLE = "SIDEGAN_CACHE"  # environment variable with the folder


def user_cache() -> Path | None:
    """Folder of ``SIDEGAN_CACHE``, or sidegan in the user's cache; None if it is not writable."""
    try:
        folder = Path(os.environ.get(_VARIABLE) or user_cache_path("sidegan", appauthor=False)).expanduser()
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # RuntimeError: the user has no home folder
        return None
    return folder.absolute() if os.access(folder, os.W_OK) else None
