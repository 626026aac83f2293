"""Reading of descriptions in all formats as URDF."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.parsers import expat

from sidegan.base.names import listed
from sidegan.base.settings_text import FILL_IN, suggestion
from sidegan.errors import RobotError
from sidegan.robot.xml import Source

_UNSET = re.compile(r"Undefined substitution argument (\w+)")
_LOST = re.compile(r"Package not found: (\S+)")
_USD = b"#usda", b"PXR-USDC"  # first bytes of such files
_SHALLOW = 4  # parts of a path below which a folder is too large to search for packages


def read_source(path: Path, args: Mapping[str, str] | None = None) -> Source:
    """A description from a URDF, MJCF or .xacro file, which is expanded with ``args``."""
    try:
        text = _expanded(path, args or {}) if path.suffix == ".xacro" else path.read_bytes()
    except OSError as error:
        raise RobotError(f"cannot read {path}: {error.strerror}") from error
    if text.startswith(_USD) or path.suffix == ".usdz":
        raise RobotError(f"{path} is a USD file, expected URDF, xacro or MJCF: export one of these from it")
    try:
        root = parsed(text)
    except (expat.ExpatError, ValueError, LookupError) as error:  # LookupError: an unknown encoding
        raise RobotError(f"{path} is not well-formed XML: {error}") from error
    if root.tag == "mujoco":
        from sidegan.robot.mjcf import read_mjcf  # MuJoCo is slow to import

        return read_mjcf(path)
    if root.tag != "robot":
        raise RobotError(
            f"{path} is not a robot description: its root element is <{root.tag}>, "
            "expected <robot> or <mujoco>"
        )
    if path.suffix == ".xacro" and root.find("link") is None:
        raise RobotError(f"{path} has no link{_only_macros(path)}{_arguments(path, args or {})}")
    return Source(text, root)


def parsed(text: bytes, comments: bool = False) -> ET.Element:
    """The root element of XML, whose names keep their prefixes: URDF does not declare all of them."""
    builder = ET.TreeBuilder(insert_comments=comments)
    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler, parser.CommentHandler = builder.data, builder.comment
    parser.Parse(text, True)
    return builder.close()


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
        if lost := _LOST.search(words):
            words = f"package {lost[1]} was not found; add the folder that contains it to ROS_PACKAGE_PATH"
        raise RobotError(
            f"{path}: xacro refuses it: {words}{_arguments(path, args, _UNSET.findall(words))}"
        ) from error


def _elements(path: Path, kind: str) -> list[ET.Element]:
    """The xacro elements of a kind outside of macros in a file that is not expanded; none if it is no XML."""
    try:
        root = parsed(path.read_bytes())
    except (OSError, expat.ExpatError, ValueError, LookupError):
        return []
    for parent in [*root.iter()] if kind != "macro" else []:
        for macro in [x for x in parent if x.tag == "xacro:macro"]:
            parent.remove(macro)
    return [*root.iter(f"xacro:{kind}")]


def _arguments(path: Path, args: Mapping[str, str], undefined: Sequence[str] = ()) -> str:
    """The end of a message: a file's arguments, and how to set those without a value, if any."""
    declared = {x.get("name", ""): x.get("default") for x in _elements(path, "arg")}
    values = {**dict.fromkeys(undefined), **declared, **args}
    if not (lacking := [name for name, value in values.items() if not value]):
        return ""
    shown = [f"{name}={value}" if value else f"{name} (without a value)" for name, value in values.items()]
    typed = {name: x for name, x in args.items() if x} | dict.fromkeys(lacking, FILL_IN)
    return f"; its arguments are {listed(shown, len(shown))}: {suggestion('robot.args', typed)}"


def _only_macros(path: Path) -> str:
    """The middle of a message: the macros that a file only defines, and a file nearby that calls one."""
    macros = {x.get("name", "").removeprefix("xacro:"): x.get("params", "") for x in _elements(path, "macro")}
    if not macros:
        return ""
    defined = [f"{name}({', '.join(params.split())})" for name, params in macros.items()]
    around = [file for folder in (".", "..", "../*") for file in path.parent.glob(f"{folder}/*.xacro")]
    callers = [file for file in around if any(_elements(file, name) for name in macros)]
    it = f"it, such as {callers[0].resolve()}" if callers else "it, or write one that includes and calls it"
    return f": it only defines {listed(defined)}; use the file that calls {it}"
