"""Redirection of MuJoCo's warnings to the log, instead of MUJOCO_LOG.TXT in the working folder."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

_log = logging.getLogger(__name__)


@contextmanager
def mujoco_logged(what: object, level: int = logging.DEBUG) -> Iterator[None]:
    """Log MuJoCo's warnings within the block, prefixed by what they are about.

    Diverging simulations are detected from the motion itself, so their warnings are only for debugging.
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: _log.log(level, "%s: %s", what, text))
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
