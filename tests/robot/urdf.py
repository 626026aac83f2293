"""Small URDFs for tests, written from their parts."""

INERTIA = """<inertial><origin xyz="0.01 -0.02 0.1" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
  <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial>"""
LIMIT = '<limit lower="-1.5" upper="2" velocity="2.5" effort="40"/>'


def link(name: str, content: str = INERTIA) -> str:
    return f'<link name="{name}">{content}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    origin: str = 'xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"',
    axis: str = '<axis xyz="0 0 1"/>',
    limit: str = LIMIT,
    extra: str = "",
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"<origin {origin}/>{axis}{limit}{extra}</joint>"
    )


def robot(*parts: str, name: str = "small") -> str:
    return f'<robot name="{name}">{"".join(parts)}</robot>'


def one_joint(inertial: str = INERTIA, collision: str = "", name: str = "small", **options: str) -> str:
    """A base and one link on a joint `turn`."""
    return robot(
        link("base", ""),
        joint("turn", "base", "arm", **options),
        link("arm", inertial + collision),
        name=name,
    )


def two_joints(**options: str) -> str:
    """Joints `first` and `second` in a chain; the options are the second's."""
    second = joint("second", "lower", "upper", **options)
    return robot(link("base", ""), joint("first", "base", "lower"), link("lower"), second, link("upper"))
