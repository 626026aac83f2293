"""MuJoCo's warnings in the log: on its own it writes them to MUJOCO_LOG.TXT in the working folder."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

_log = logging.getLogger(__name__)


@contextmanager
def mujoco_logged(what: object, level: int = logging.DEBUG) -> Iterator[None]:
    """Within the block, MuJoCo's warnings about something go to the log, with its name before them.

    Simulations that leave all bounds are told by those who look at the motion: their warnings are details.
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: _log.log(level, "%s: %s", what, text))
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
