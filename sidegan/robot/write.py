"""A URDF with other inertias and friction: the source's text, byte for byte, but for those elements."""

import re
import xml.parsers.expat as expat
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

from sidegan.base.storage import replacing
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import Arm
from sidegan.robot.consistency import about_the_centre, require_consistent
from sidegan.robot.description import read_description
from sidegan.robot.drives import Drives
from sidegan.robot.setup import PLAIN
from sidegan.robot.sources import read_source

_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
_CHILD, _GRANDCHILD = 2, 3  # depth of the robot's links and joints, and of what they are made of
_TOLERANCE = 1e-12  # of the largest parameter: what writing and reading may cost


Element = tuple[str, str, str]  # a child of the robot's by tag and name, and the tag of the child's own child


def write_urdf(arm: Arm, parameters: Tensor, path: Path, drives: Drives | None = None) -> None:
    """Write the arm's URDF with these inertial parameters in place of its own, and nothing else changed.

    Each joint's parameters go to the link that it moves; links that are fixed to that one lose their
    inertia, which is part of it already. The file appears whole, and only after it was read back to the
    same parameters.

    Args:
        arm: the arm, read from a URDF.
        parameters: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joints' frames, (J, 10).
        path: where to write; beside the source, if mesh files are named relative to it.
        drives: friction for the joints' `<dynamics>`, which stays as it is when None; a URDF has no place
            for the inertia of rotors.

    Raises:
        RobotError: when a link would not be physically consistent, the source is no longer the arm's,
            or cannot carry the parameters.
        ShapeError: when the parameters are not (J, 10).
        StorageError: when the file cannot be written.
    """
    parameters = parameters.detach().double().cpu()
    require_consistent(arm, parameters)
    carriers = _carriers(arm)
    inertials = {link: _inertial(row) for link, row in zip(arm.link_names, parameters)}
    replacements: dict[Element, bytes] = {
        ("link", link, "inertial"): inertials.get(link, b"")
        for link, carrier in carriers.items()
        if carrier is not None
    }
    if drives is not None:
        pairs = zip(arm.joint_names, drives.viscous.tolist(), drives.coulomb.tolist())
        replacements |= {("joint", name, "dynamics"): _dynamics(*friction) for name, *friction in pairs}
    text = read_source(arm.urdf, arm.setup.args).text
    with replacing(path) as draft:
        draft.write_bytes(_replaced(text, replacements))
        _check(arm, parameters, draft)


def _carriers(arm: Arm) -> dict[str, str | None]:
    """Which moved link each link is part of; None for those on the base.

    Raises:
        RobotError: when the file's joints are not the arm's.
    """
    if not arm.urdf.is_file():
        raise RobotError(f"{arm.name} has no URDF to start from: there is no file {arm.urdf}")
    root = read_source(arm.urdf, arm.setup.args).root
    joints = [j for j in root.findall("joint") if j.get("type") is not None]
    ends = {_end(j, "child"): (_end(j, "parent"), j) for j in joints}
    moved = {_end(j, "child"): j.get("name") for j in joints if j.get("name") in arm.joint_names}
    free = {j.get("name") for j in joints if j.get("type") != "fixed"}
    locked = arm.setup != PLAIN or bool(arm.told)
    if moved != dict(zip(arm.link_names, arm.joint_names)) or not (locked or free == set(moved.values())):
        raise RobotError(f"{arm.urdf} is no longer the description of {arm.name}: its joints are others")

    def carrier(link: str) -> str | None:
        while link not in moved:
            if link not in ends:
                return None
            link = ends[link][0]
        return link

    return {name: carrier(name) for link in root.findall("link") if (name := link.get("name", ""))}


def _end(joint: "xml.ET.Element", end: str) -> str:
    return xml.child(joint, end, joint.get("name", "")).get("link", "")


def _inertial(parameters: Tensor) -> bytes:
    """An `<inertial>` element of parameters (10,), about the centre of mass."""
    centre, inertia = (x[0] for x in about_the_centre(parameters[None]))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    place = " ".join(map(repr, centre.tolist()))
    lines = [
        "<inertial>",
        f'      <mass value="{float(parameters[0])!r}"/>',
        f'      <origin xyz="{place}" rpy="0 0 0"/>',
        f'      <inertia ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}"',
        f'               iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"/>',
        "    </inertial>",
    ]
    return "\n".join(lines).encode("ascii")


def _dynamics(viscous: float, coulomb: float) -> bytes:
    """A `<dynamics>` element; neither coefficient below 0, which no reader takes."""
    return f'<dynamics damping="{max(viscous, 0.0)!r}" friction="{max(coulomb, 0.0)!r}"/>'.encode("ascii")


def _replaced(text: bytes, elements: dict[Element, bytes]) -> bytes:
    """A URDF's text with these elements replaced, inserted, or (empty) taken out."""
    parser = expat.ParserCreate()
    path: list[str] = []
    owner, opened = ("", ""), 0
    spans: dict[Element, tuple[int, int]] = {}
    missing: list[tuple[Element, int]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal owner, opened
        path.append(tag)
        if len(path) == _CHILD:
            owner, opened = (tag, attributes.get("name", "")), parser.CurrentByteIndex
        elif len(path) == _GRANDCHILD and (*owner, tag) in elements:
            spans.setdefault((*owner, tag), _opened(text, parser.CurrentByteIndex))

    def end(tag: str) -> None:
        element = (*owner, tag)
        if len(path) == _GRANDCHILD and element in spans and spans[element][1] < 0:
            spans[element] = spans[element][0], _tag_end(text, parser.CurrentByteIndex)
        elif len(path) == _CHILD:
            own = (key for key in elements if key[:2] == owner and elements[key] and key not in spans)
            missing.extend((key, opened) for key in own)
        path.pop()

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(text, True)
    edits = [(*span, elements[key]) for key, span in spans.items()]
    edits += [_insertion(text, position, key[0], elements[key]) for key, position in missing]
    for first, last, new in sorted(edits, reverse=True):
        text = text[:first] + new + text[last:]
    return text


def _opened(text: bytes, position: int) -> tuple[int, int]:
    """The span of an element that opens at a byte; its end is -1 where it is not closed by the same tag."""
    end = _tag_end(text, position)
    return position, end if text[end - 2 : end] == b"/>" else -1


def _insertion(text: bytes, position: int, tag: str, element: bytes) -> tuple[int, int, bytes]:
    """Put an element as first child into the one with this tag that opens at a byte."""
    end = _tag_end(text, position)
    if text[end - 2 : end] != b"/>":
        return end, end, b"\n    " + element
    return end - 2, end, b">\n    " + element + b"\n  </" + tag.encode("ascii") + b">"


def _tag_end(text: bytes, position: int) -> int:
    """The byte after the tag that opens at a byte."""
    tag = _TAG.match(text, position)
    if tag is None or b"\0" in tag.group():
        raise RobotError("tags take more than a byte per letter in this file's encoding: save it as UTF-8")
    return tag.end()


def _check(arm: Arm, parameters: Tensor, file: Path) -> None:
    """Raise unless the file reads as the same arm with these parameters."""
    from sidegan.robot import model as pin_model

    setup = replace(arm.setup, args=None, home=None, mount=arm.mount)
    model = pin_model.build(read_description(file, setup, planning=False))
    chain = pin_model.kinematics_and_inertias(model, setup.tip)
    del chain["gravity"]  # no URDF states it
    same = {name: getattr(arm, name) for name in chain} | {"inertial_parameters": parameters}
    for name, value in chain.items():
        scale = float(same[name].double().abs().max())
        if value.shape != same[name].shape or not torch.allclose(
            value.double(), same[name].double(), rtol=0, atol=_TOLERANCE * max(scale, 1.0)
        ):
            what = name.replace("_", " ")
            raise RobotError(f"{arm.urdf} with new inertias does not read as {arm.name}: another {what}")
