"""A page that animates an arm along trajectories: a self-contained HTML file.

It contains plain values, packed arrays of four-byte numbers, the 3D library and our scripts.
"""

import base64
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from markupsafe import Markup
from numpy.typing import NDArray

from sidegan.base.arrays import Array, flatten
from sidegan.base.storage import write_bytes
from sidegan.errors import ArtifactError
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.report.document import rendered
from sidegan.report.style import PALETTE
from sidegan.robot import Arm
from sidegan.robot.visuals import Surface, capsule_surface, visual_parts
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from sidegan.validity.constraints import DISTANCES

Content: TypeAlias = dict[str, Any]  # plain values and arrays of a page

_RATE, _FEWEST, _MOST = 25.0, 100, 500  # sampling rate of a motion [Hz], least and most samples
_TRIANGLES = 120_000  # most triangles of an arm
_FINEST, _COARSER = 5e-4, 1.4  # smallest grid cell for merging vertices [m], and factor to the next size


def write_view(
    path: Path,
    constraints: Constraints,
    arm: Arm,
    family: Trajectory,
    coefficients: Array,
    titles: Sequence[str],
    table: pd.DataFrame,
    steps: Sequence[tuple[str, str]] = (),
) -> None:
    """Write a page with trajectories of coefficients [rad/s], (B, J, H, 2), in the constraints' workspace.

    Signals are relative to the limits of ``arm``, which are its full ones. The table has the demands of each
    trajectory, a row each; steps are instructions, a sentence and a command each.

    Raises:
        ArtifactError: when trimesh has no three.js.
    """
    samples = int(min(max(family.period * _RATE, _FEWEST), _MOST))
    motion = family.roll_out(coefficients, np.linspace(0.0, family.period, samples + 1))
    content: Content = {
        "name": arm.name,
        "joints": list(arm.joint_names),
        "prismatic": arm.prismatic.tolist(),
        "period": family.period,
        "samples": samples,
        "titles": list(titles),
        "checked": constraints.described(),
        "colours": list(PALETTE),
        "chain": {
            "rotation": flatten(arm.rotation, 1).tolist(),  # row by row
            "translation": arm.translation.tolist(),
            "axis": arm.axis.tolist(),
            "tip": arm.tip.tolist(),
        },
        **_signals(arm, constraints, motion),
        **_closest(constraints, motion),
        **_surfaces(constraints),
    }
    arrays = {name: x for name, x in content.items() if isinstance(x, np.ndarray)}
    head = {name: x for name, x in content.items() if name not in arrays}
    places, packed = _packed(arrays)
    page = rendered(
        Path(__file__).parent / "viewer.html.jinja",
        {},
        title=f"Trajectories of {arm.name}",
        view=head,
        table=table.reset_index(),
        steps=steps,
        data=head | {"arrays": places},
        arrays=Markup(packed),
        library=Markup(_three_js()),
    )
    write_bytes(path, page)


def _signals(arm: Arm, constraints: Constraints, motion: Motion) -> Content:
    """Position, velocity, acceleration and torque relative to their limits, (B, T, J) each."""
    middle = (arm.position_upper + arm.position_lower) / 2
    unlimited = np.full(arm.joints, np.inf)
    signals = {
        "position": (motion.position - middle, (arm.position_upper - arm.position_lower) / 2),
        "velocity": (motion.velocity, arm.velocity_limit),
        "acceleration": (motion.acceleration, arm.higher_limits.get("acceleration", unlimited)),
        "torque": (constraints.body.drive_torque(*motion[1:]), arm.torque_limit),
    }
    content: Content = {"middle": middle.tolist(), "signals": {}}
    for name, (values, limit) in signals.items():
        largest = np.maximum(np.abs(values).max((0, 1)), 1e-9)
        limited = np.isfinite(limit)
        scale = np.where(limited, limit, largest)
        content["signals"][name] = {"scale": scale.tolist(), "limited": limited.tolist()}
        content[name] = (values / scale).astype(np.float32)
    return content


def _closest(constraints: Constraints, motion: Motion) -> Content:
    """The closest pair and its distance [m]; empty without pairs."""
    names = [label for name in DISTANCES for label in constraints.labels.get(name, ())]
    distance, which = constraints.nearest(motion.position.reshape(-1, constraints.arm.joints))
    if not np.isfinite(distance).all():
        return {"pairs": []}
    used, which = np.unique(which, return_inverse=True)
    return {
        "pairs": [names[k] for k in used.tolist()],
        "pair": which.astype(np.uint32),
        "distance": distance.astype(np.float32),
    }


def _surfaces(constraints: Constraints) -> Content:
    """Surfaces of the arm, its capsules, and obstacles; links without a visual show their capsules."""
    capsules = constraints.arm.capsules
    each = zip(capsules.link.tolist(), capsules.a, capsules.b, capsules.radius.tolist())
    shapes = [Surface(link, *capsule_surface(a, b, radius)) for link, a, b, radius in each]
    looks = visual_parts(constraints.arm)
    seen = {part.link for part in looks}
    looks = fewer([*looks, *(part for part in shapes if part.link not in seen)])
    planes = [region for region in constraints.regions if isinstance(region, Plane)]
    obstacles = [region_surface(region) for region in constraints.regions if not isinstance(region, Plane)]
    content: Content = {"planes": [{"normal": plane.unit, "offset": plane.offset} for plane in planes]}
    for kind, parts in (("arm", looks), ("shapes", shapes), ("obstacles", obstacles)):
        content[kind] = [part.link for part in parts]
        for k, part in enumerate(parts):
            content[f"{kind}{k}v"] = part.vertices.astype(np.float32)
            content[f"{kind}{k}f"] = part.faces.astype(np.uint32)
    return content


def region_surface(region: Box | Sphere | Convex) -> Surface:
    """The surface of a bounded keep-out region."""
    import trimesh  # slow to import

    if isinstance(region, Sphere):
        mesh = trimesh.creation.icosphere(3, region.radius).apply_translation(region.centre)
    elif isinstance(region, Convex):
        mesh = trimesh.convex.convex_hull(region.points)
    else:
        mesh = trimesh.creation.box(bounds=[region.lower, region.upper])
    return Surface(-1, np.asarray(mesh.vertices), np.asarray(mesh.faces))


def fewer(parts: Sequence[Surface]) -> list[Surface]:
    """Surfaces with coincident vertices merged, and nearby ones too if there are too many triangles.

    Vertices in a grid cell are replaced by their mean; degenerate triangles are dropped.
    """
    made = [_clustered(part, _FINEST / 100) for part in parts]
    size = _FINEST
    while sum(len(part.faces) for part in made) > _TRIANGLES:
        made = [_clustered(part, size) for part in parts]
        size *= _COARSER
    return [part for part in made if len(part.faces)]


def _clustered(part: Surface, size: float) -> Surface:
    """A surface whose vertices in the same cell of a grid [m] are merged to their mean."""
    from trimesh.grouping import unique_rows

    _, index = unique_rows(np.floor(part.vertices / size).astype(np.int64))
    count = np.bincount(index)
    means = np.stack([np.bincount(index, column) for column in part.vertices.T], 1) / count[:, None]
    faces = index[part.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(1)]
    return Surface(part.link, means, faces[unique_rows(np.sort(faces, axis=1))[0]])


def _packed(arrays: Mapping[str, NDArray[Any]]) -> tuple[dict[str, list[Any]], str]:
    """Type, offset and size of each array, and all of them as text (deflated, base 64)."""
    places: dict[str, list[Any]] = {}
    offset = 0
    for name, x in arrays.items():
        places[name] = [x.dtype.name, offset, int(x.size)]
        offset += x.nbytes
    data = b"".join(x.tobytes() for x in arrays.values())
    return places, base64.b64encode(zlib.compress(data, 9)).decode()


def _three_js() -> str:
    """The library three.js with its licence, which is the first script of trimesh's own pages."""
    import trimesh  # slow to import
    from trimesh.viewer import scene_to_html

    page = scene_to_html(trimesh.Scene(trimesh.creation.box()))
    script = re.search(r"<script>(.*?\.THREE=\{\}[^\n]*)", page, re.DOTALL)
    if script is None:
        raise ArtifactError("this version of trimesh has no three.js: pip install 'trimesh>=4.8.3,<6'")
    return script[1]
