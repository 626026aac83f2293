"""Compiled kernels; the only door to numba.

They are used where numba is installed. The environment variable ``SIDEGAN_KERNELS`` decides otherwise:
``torch`` for the plain code, which is the readable reference, ``numba`` for an error when numba is missing.
"""

import logging
import os
from functools import cache

from sidegan.errors import ConfigError

VARIABLE = "SIDEGAN_KERNELS"

log = logging.getLogger(__name__)


def compiled() -> bool:
    """Whether compiled kernels are used.

    Raises:
        ConfigError: when the environment asks for what there is not.
    """
    wish = os.environ.get(VARIABLE, "")
    if wish not in ("", "torch", "numba"):
        raise ConfigError(f"{VARIABLE} is {wish!r}, expected torch or numba")
    if wish == "numba" and not _installed():
        raise ConfigError(f"{VARIABLE} asks for numba, which is not installed")
    return wish != "torch" and _installed()


@cache
def _installed() -> bool:
    try:
        import numba  # noqa: F401
    except ImportError as error:  # missing, or unfit for the NumPy at hand
        log.info("kernels are not compiled: %s", error)
        return False
    return True
