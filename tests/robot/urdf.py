"""Small descriptions for tests, written from their parts, and meshes for them."""

import numpy as np

INERTIA = """<inertial><origin xyz="0.01 -0.02 0.1" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
  <inertia ixx="0.025" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial>"""


def limit(lower: object = -1.5, upper: object = 2, velocity: float = 2.5, effort: float = 40) -> str:
    return f'<limit lower="{lower}" upper="{upper}" velocity="{velocity}" effort="{effort}"/>'


def link(name: str, content: str = INERTIA) -> str:
    return f'<link name="{name}">{content}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    origin: str = 'xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"',
    axis: str = "0 0 1",
    limit: str = limit(),
    extra: str = "",
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin {origin}/><axis xyz="{axis}"/>{limit}{extra}</joint>'
    )


def robot(*parts: str, name: str = "small") -> str:
    return f'<robot name="{name}">{"".join(parts)}</robot>'


def more(text: str, *parts: str) -> str:
    return text.replace("</robot>", "".join(parts) + "</robot>")


def one_joint(inertial: str = INERTIA, collision: str = "", name: str = "small", **options: str) -> str:
    """A base and one link on a joint `turn`."""
    arm = link("arm", inertial + collision)
    return robot(link("base", ""), joint("turn", "base", "arm", **options), arm, name=name)


def two_joints(**options: str) -> str:
    """Joints `first` and `second` in a chain; the options are the second's."""
    second = joint("second", "lower", "upper", **options)
    return robot(link("base", ""), joint("first", "base", "lower"), link("lower"), second, link("upper"))


def collision(shape: str, origin: str = 'xyz="0 0 0"', name: str = "") -> str:
    return f"<collision{name}><origin {origin}/><geometry>{shape}</geometry></collision>"


def visual(shape: str, origin: str = 'xyz="0 0 0"') -> str:
    return f"<visual><origin {origin}/><geometry>{shape}</geometry></visual>"


def mesh(file: object, origin: str = 'xyz="0 0 0"', scale: str = "1 1 1") -> str:
    return collision(f'<mesh filename="{file}" scale="{scale}"/>', origin)


def ball(radius: float, place: str = "0 0 0") -> str:
    return collision(f'<sphere radius="{radius}"/>', f'xyz="{place}"')


def outside(points: np.ndarray, a: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """How far points (N, 3) are outside of a capsule [m], (N,); negative inside."""
    along = b - a
    share = np.clip((points - a) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - a - np.outer(share, along), axis=1) - radius
