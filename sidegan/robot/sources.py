"""Reading of descriptions in all formats as URDF."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from sidegan.errors import RobotError
from sidegan.robot.xml import Source

_SHALLOW = 4  # parts of a path below which a folder is too large to search for packages


def read_source(path: Path, args: Mapping[str, str] | None = None) -> Source:
    """A description from a URDF, MJCF or .xacro file, which is expanded with ``args``."""
    try:
        text = _expanded(path, args or {}) if path.suffix == ".xacro" else path.read_bytes()
    except OSError as error:
        raise RobotError(f"cannot read {path}: {error.strerror}") from error
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError, LookupError) as error:  # LookupError: an unknown encoding
        raise RobotError(f"{path} is not well-formed XML: {error}") from error
    if root.tag == "mujoco":
        from sidegan.robot.mjcf import read_mjcf  # MuJoCo is slow to import

        return read_mjcf(path)
    if root.tag != "robot":
        raise RobotError(
            f"{path} is not a robot description: its root element is <{root.tag}>, "
            "expected <robot> or <mujoco>"
        )
    return Source(text, root)


def _expanded(path: Path, args: Mapping[str, str]) -> bytes:
    """The URDF of a xacro file; packages are searched above it, beside its package, and on the ROS paths."""
    try:
        import xacro
        from xacrodoc import packages  # lets xacro find packages without ROS
    except ImportError:
        raise RobotError(
            f"{path} needs xacrodoc: pip install 'sidegan[xacro]', or in ROS: xacro {path.name} > arm.urdf"
        ) from None
    packages.reset()
    packages.walk_up_from(path)
    around = path.resolve().parents[2:3]
    if around and len(around[0].parts) >= _SHALLOW:
        packages.look_in([str(around[0])], priority=1)
    try:
        return xacro.process_file(str(path), mappings=dict(args)).toxml("utf-8")
    except Exception as error:  # xacro evaluates expressions, which may raise anything
        words = " ".join(str(error).split()) or type(error).__name__
        raise RobotError(
            f"{path}: xacro refuses it: {words}; arguments are set by 'robot.args={{name: value}}', and "
            "packages are searched on ROS_PACKAGE_PATH"
        ) from error
