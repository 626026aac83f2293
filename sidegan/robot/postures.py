"""Where an arm rests by its description: keyframes of an MJCF, group states of an SRDF beside a URDF."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

Posture = Mapping[str, float]  # positions of joints by name [rad or m]

_HOMES = "home", "ready"  # names of the posture that is meant, the first before the second
_FOLDERS = ".", "../srdf", "../config"  # where an SRDF lies, from the folder of its URDF


def home_among(postures: Mapping[str, Posture], joints: Sequence[str]) -> tuple[float, ...] | None:
    """Positions of the joints, (J,), in the posture that is named home, or in the only one; or None."""
    whole = {name.lower(): x for name, x in postures.items() if set(joints) <= set(x)}
    named = [whole[name] for name in _HOMES if name in whole]
    found = named or ([*whole.values()] if len(whole) == 1 else [])
    return tuple(found[0][joint] for joint in joints) if found else None


def group_states(urdf: Path, robot: str) -> dict[str, Posture]:
    """Postures of a robot by name, of all groups, by the SRDF files of that robot beside its URDF."""
    found: dict[str, dict[str, float]] = {}
    for state in _states(urdf, robot):
        posture = found.setdefault(state.get("name", ""), {})
        for joint in state.findall("joint"):
            with suppress(ValueError):  # what has several values is no joint of an arm
                posture[joint.get("name", "")] = float(joint.get("value", ""))
    return dict(found)


def _states(urdf: Path, robot: str) -> Iterator[ET.Element]:
    for folder in _FOLDERS:
        for file in sorted((urdf.parent / folder).glob("*.srdf")):
            with suppress(ET.ParseError, OSError):
                root = ET.parse(file).getroot()
                if root.get("name") == robot:
                    yield from root.findall("group_state")
