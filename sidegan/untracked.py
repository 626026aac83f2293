"""Send later what could not be sent to MLflow: ``python -m sidegan.untracked outputs --uri http://host:5000``."""

import argparse
import json
import logging
import os
import sys
from pathlib import Path
from typing import Any

from sidegan.base.storage import write_bytes
from sidegan.pipeline.tracking import SENDING, UNTRACKED, Tracker

log = logging.getLogger(__name__)


def send_kept(folder: Path, root: Path, uri: str | None = None) -> bool:
    """Whether everything that a run's folder kept has arrived now; what has not stays kept.

    Args:
        folder: of the run.
        root: folder of all results.
        uri: tracking server or database; None is sqlite in ``root``.
    """
    kept, sending = folder / UNTRACKED, folder / SENDING
    _set_aside(kept, sending)
    lines = _lines(sending)
    tracker = Tracker.resumed(root, folder, uri, lines[0]["run"] if lines else None)
    for i, line in enumerate(lines):
        tracker.send(line["kind"], line["content"], line["time"])
        if not tracker.reached:
            rest = (json.dumps({**one, "run": tracker.run_id}) for one in lines[i:])
            write_bytes(sending, "".join(f"{text}\n" for text in rest).encode())
            if not kept.exists():  # its run may still be running
                sending.rename(kept)
            return False
    sending.unlink(missing_ok=True)
    return True


def _set_aside(kept: Path, sending: Path) -> None:
    """What is sent now, in a file of its own, since the run may go on. One may be left of a kill."""
    if not kept.exists():
        return
    if sending.exists():
        with sending.open("a", encoding="utf-8") as file:
            file.write(kept.read_text(encoding="utf-8"))
        kept.unlink()
    else:
        kept.rename(sending)


def _lines(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    lines = []
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            lines.append(json.loads(text))
        except ValueError:  # of a run that was killed while it wrote
            log.warning("%s has half a line, which is left out", path)
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Exit code: 0 when everything that was kept has arrived, 1 otherwise."""
    parser = argparse.ArgumentParser(description="Send to MLflow what runs could not send.")
    parser.add_argument("outputs", type=Path, help="folder of all results")
    parser.add_argument(
        "--uri",
        default=os.environ.get("MLFLOW_TRACKING_URI"),
        help="tracking server or database; MLFLOW_TRACKING_URI, or sqlite in the outputs, by default",
    )
    parser.add_argument("--only", type=Path, help="folder of a run; all of the outputs by default")
    chosen = parser.parse_args(arguments)
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    names = (UNTRACKED, SENDING)
    folders = sorted({path.parent for name in names for path in (chosen.only or chosen.outputs).rglob(name)})
    missing = 0
    for folder in folders:
        sent = send_kept(folder, chosen.outputs, chosen.uri)
        missing += not sent
        log.info("%s: %s", folder, "sent" if sent else "still kept")
    log.info("%d of %d runs are sent", len(folders) - missing, len(folders))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
