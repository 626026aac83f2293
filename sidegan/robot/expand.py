"""A xacro file expanded into URDF, where xacrodoc is installed."""

import re
from collections.abc import Mapping
from pathlib import Path

from sidegan.errors import RobotError

_UNSET = re.compile(r"Undefined substitution argument (\w+)")
_LOST = re.compile(r"Package not found: (\S+)")
_SHALLOW = 4  # parts of a path whose folders are too many to be searched for packages


def expand(path: Path, args: Mapping[str, str]) -> bytes:
    """The URDF that a xacro file describes.

    Packages are looked for above the file, beside its own one, and on the ROS paths.

    Args:
        path: the file.
        args: values of its arguments, by name.

    Raises:
        RobotError: when xacrodoc is not installed or refuses the file, with what resolves it.
    """
    try:
        from xacrodoc import XacroDoc, packages
    except ImportError:
        raise RobotError(
            f"{path} needs xacrodoc: pip install 'sidegan[xacro]', or in ROS: xacro {path.name} > arm.urdf"
        ) from None
    if not path.is_file():
        raise RobotError(f"there is no xacro file {path}")
    packages.reset()
    around = path.resolve().parents[2:3]
    if around and len(around[0].parts) >= _SHALLOW:
        packages.look_in([str(around[0])], priority=1)
    try:
        document = XacroDoc.from_file(path, subargs=dict(args), resolve_packages=False)
        return document.dom.toxml("utf-8")
    except Exception as error:  # xacro evaluates expressions: anything can go wrong in there
        raise RobotError(f"{path}: xacro refuses it: {_reason(error, args)}") from error


def _reason(error: Exception, args: Mapping[str, str]) -> str:
    """Why xacro refuses a file, and what to do about it where that is known."""
    words = " ".join(str(error).split()) or type(error).__name__
    if unset := _UNSET.search(words):
        given = "".join(f"{name}: {value}, " for name, value in args.items())
        return f"{words}; state it by 'robot.args={{{given}{unset[1]}: …}}'"
    if lost := _LOST.search(words):
        return f"there is no package {lost[1]}; put the folder that holds it on ROS_PACKAGE_PATH"
    return words
