"""The table of errors on recordings of real arms, from made-up ones."""

import sys

import numpy as np
import pytest
import yaml

from benchmarks.recordings import METHODS, report
from sidegan.errors import ConfigError
from tests.recording.files import write_moved
from tests.refusals import refused

PLANAR = {"source": "made up", "cell": {"robot": "planar2"}, "recordings": ["0.csv"], "validation": ["1.csv"]}


def written(folder, **changes):
    """A folder with the settings of one arm."""
    (folder / "planar").mkdir()
    (folder / "planar" / "arm.yaml").write_text(yaml.safe_dump(PLANAR | changes))
    return folder


def test_a_row_of_each_method_and_a_note_of_each_arm(planar, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "figaroh", None)  # as where it is not installed
    folder = written(tmp_path)
    for seed in range(2):
        write_moved(folder / "planar" / f"{seed}.csv", planar, seed, seconds=15)
    table, notes = report(folder).split("\n\n")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]
    assert [row[:2] for row in rows] == [["planar", method] for method in METHODS]
    assert notes == "- planar: made up\n"
    for _, method, each, mean, geometric, _ in rows:
        if method == "FIGAROH":
            assert "figaroh" in each and mean == "—"
        else:  # noise has 0.0004 of the variance
            errors = np.array(each.split(", "), float)
            assert len(errors) == 2 and max(errors) < 0.01
            assert errors.min() <= float(geometric) <= float(mean) <= errors.max()


@pytest.mark.parametrize(
    ("changes", "about"),
    [({"recordins": []}, ("recordins", "recordings")), ({"validation": []}, ("validation",))],
)
def test_wrong_settings_are_named(tmp_path, changes, about):
    with refused(ConfigError, *about):
        report(written(tmp_path, **changes))


def test_a_folder_without_arms_is_refused(tmp_path):
    with refused(ConfigError, str(tmp_path)):
        report(tmp_path)
