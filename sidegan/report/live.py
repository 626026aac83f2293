"""The command ``python -m sidegan.report.live RUN``: the set of a run in a live viewer.

It shows what the run's view.html shows, by viser (the extra `view`), which keeps the scene on a server.
"""

import argparse
import base64
import json
import re
import sys
import time
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sidegan.errors import ArtifactError, SideganError
from sidegan.robot.locking import rotation

if TYPE_CHECKING:  # an extra
    import viser

PAGE = "view.html"
_TICK = 1 / 30  # [s] between two pictures
_NEAREST = 0.2  # [m] of the camera, and more with the arm's reach
_PLAIN = (0.66, 0.7, 0.74)  # colour of what has none
_OBSTACLE = (0.78, 0.49, 0.04)

Numbers = NDArray[np.float64]


class Show:
    """The content of a page on which an arm moves."""

    def __init__(self, path: Path) -> None:
        try:
            text = path.read_text(encoding="utf-8")
            data, arrays = (
                re.search(rf'id="{name}">(.*?)</script>', text, re.S) for name in ("data", "arrays")
            )
            if data is None or arrays is None:
                raise ValueError("it shows no arm")
            self.head: dict[str, Any] = json.loads(data[1])
            block = zlib.decompress(base64.b64decode(arrays[1]))
        except (OSError, ValueError, zlib.error) as error:
            raise ArtifactError(f"{path} is no page that excite has written: {error}") from error
        self.arrays = {
            name: np.frombuffer(block, kind, size, offset)
            for name, (kind, offset, size) in self.head["arrays"].items()
        }

    def surface(self, kind: str, k: int) -> tuple[Numbers, NDArray[np.uint32]]:
        """Vertices [m], (V, 3), and faces, (F, 3), of a surface in its joint's frame."""
        head = self.head[kind][k]
        steps = self.arrays[f"{kind}{k}v"].reshape(-1, 3)
        faces = self.arrays[f"{kind}{k}f"].reshape(-1, 3).astype(np.uint32)
        return np.array(head["low"]) + steps * np.array(head["step"]), faces

    def positions(self, trajectory: int, share: float) -> Numbers:
        """Joint positions [rad or m], (J,), at a share of the period."""
        joints, samples = len(self.head["joints"]), self.head["samples"]
        rows = self.arrays["position"].reshape(-1, samples + 1, joints)[trajectory]
        low = min(int(share * samples), samples - 1)
        part = share * samples - low
        shares = ((1 - part) * rows[low] + part * rows[low + 1]) / self.head["steps"]
        return np.array(self.head["middle"]) + np.array(self.head["signals"]["position"]["scale"]) * shares

    def frames(self, q: Numbers) -> tuple[Numbers, Numbers]:
        """Rotations (J, 3, 3) and origins [m], (J, 3), of the joints' frames in the world."""
        chain, turn, place = self.head["chain"], np.eye(3), np.zeros(3)
        turns, places = [], []
        for k, slides in enumerate(self.head["prismatic"]):
            place = place + turn @ np.array(chain["translation"][k])
            turn = turn @ np.array(chain["rotation"][k]).reshape(3, 3)
            axis = np.array(chain["axis"][k])
            if slides:
                place = place + turn @ axis * q[k]
            else:
                turn = turn @ rotation(axis, q[k])
            turns.append(turn)
            places.append(place)
        return np.array(turns), np.array(places)


def serve(show: Show, host: str, port: int) -> None:
    """Show it at an address until the process is interrupted.

    Raises:
        ArtifactError: when viser is not installed.
    """
    try:
        import viser
    except ImportError as error:
        raise ArtifactError("the live viewer needs viser: pip install 'sidegan[view]'") from error
    server = viser.ViserServer(host=host, port=port)
    frames = _add_scene(server, show)
    reach = float(np.linalg.norm(show.head["chain"]["translation"], axis=1).sum()) + _NEAREST

    @server.on_client_connect
    def look(client: "viser.ClientHandle") -> None:
        client.camera.position = (1.5 * reach, -1.7 * reach, 1.2 * reach)
        client.camera.look_at = (0.0, 0.0, 0.35 * reach)

    titles = list(show.head["titles"])
    which = server.gui.add_dropdown("trajectory", titles)
    at = server.gui.add_slider("time [s]", 0.0, show.head["period"], 0.01, 0.0)
    playing = server.gui.add_checkbox("play", True)
    speed = server.gui.add_slider("speed", 0.1, 4.0, 0.1, 1.0)
    while True:
        if playing.value:
            at.value = (at.value + _TICK * speed.value) % show.head["period"]
        q = show.positions(titles.index(which.value), at.value / show.head["period"])
        for frame, turn, place in zip(frames, *show.frames(q)):
            frame.wxyz, frame.position = quaternion(turn), place
        time.sleep(_TICK)


def _add_scene(server: "viser.ViserServer", show: Show) -> list["viser.FrameHandle"]:
    """Put the arm and its obstacles into the scene; the frames that move come back."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.add_grid("/floor", 4.0, 4.0)
    frames = [scene.add_frame(f"/joint_{k}", show_axes=False) for k in range(len(show.head["joints"]))]
    for kind, colour in (("arm", _PLAIN), ("obstacles", _OBSTACLE)):
        for k, head in enumerate(show.head[kind]):
            vertices, faces = show.surface(kind, k)
            above = "" if head["link"] < 0 else f"/joint_{head['link']}"
            opacity = None if kind == "arm" else 0.5
            name = f"{above}/{kind}_{k}"
            scene.add_mesh_simple(name, vertices, faces, color=head["colour"] or colour, opacity=opacity)
    return frames


def quaternion(turn: Numbers) -> Numbers:
    """A rotation (3, 3) as a quaternion, scalar first."""
    # The largest eigenvector of this matrix is the quaternion. Source: Bar-Itzhack 2000.
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn
    matrix = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, yx + xy, xz + zx],
            [xz - zx, yx + xy, yy - xx - zz, zy + yz],
            [yx - xy, xz + zx, zy + yz, zz - xx - yy],
        ]
    )
    return np.linalg.eigh(matrix)[1][:, -1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command."""
    parser = argparse.ArgumentParser(
        prog="python -m sidegan.report.live", description="A set in a live viewer."
    )
    parser.add_argument("run", type=Path, help=f"the folder of a run of excite, or its {PAGE}")
    parser.add_argument("--host", default="127.0.0.1", help="to listen at (default: this machine alone)")
    parser.add_argument("--port", type=int, default=8080, help="of the server (default 8080)")
    options = parser.parse_args(arguments)
    try:
        show = Show(options.run / PAGE if options.run.is_dir() else options.run)
        serve(show, options.host, options.port)
    except KeyboardInterrupt:
        return 0
    except SideganError as error:
        sys.stderr.write(f"error: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
