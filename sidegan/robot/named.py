"""Arms by name, where robot_descriptions is installed."""

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from sidegan.errors import RobotError

_NAME = re.compile(r"[a-z][a-z0-9_]*")


def by_name(name: str) -> tuple[Path, dict[str, str]] | None:
    """File of a description that robot_descriptions knows, and its arguments if it is a xacro file.

    The name is one such as "panda" or "panda_description"; "panda_mj_description" is the MJCF. Its first use
    fetches it from the network. None where robot_descriptions is not installed, or knows no such name.

    Raises:
        RobotError: when the description cannot be fetched.
    """
    if not _NAME.fullmatch(name) or find_spec("robot_descriptions") is None:
        return None
    stem = "robot_descriptions." + name.removesuffix("_description")
    module = next((stem + end for end in ("_description", "_mj_description") if find_spec(stem + end)), None)
    if module is None:
        return None
    try:
        found = import_module(module)
    except Exception as error:  # git, the network, the disk
        words = " ".join(str(error).split())
        raise RobotError(
            f"robot_descriptions cannot fetch {module.partition('.')[2]}: {words}; with a file of your own: "
            "robot.name=arm.urdf"
        ) from error
    for kind in ("URDF_PATH", "XACRO_PATH", "MJCF_PATH"):
        if hasattr(found, kind):
            args = getattr(found, "XACRO_ARGS", {}) if kind == "XACRO_PATH" else {}
            return Path(getattr(found, kind)), dict(args)
    return None
