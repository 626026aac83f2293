"""The page on the closed loop: its numbers are counted right, it is written, and it goes on where it was."""

import numpy as np
import pandas as pd
import pytest

from benchmarks import loop

pytest.importorskip("numba")

NOT_YET = float("nan")
ROWS = [
    # way, plant, seconds, deviation
    ("quick", 0, 8.0, 0.006), ("quick", 0, 16.0, 0.004),
    ("quick", 1, 8.0, 0.02), ("quick", 1, 16.0, 0.0074),
    ("slow", 0, 8.0, 0.02), ("slow", 0, 16.0, 0.0074),
    ("slow", 1, 8.0, 0.03), ("slow", 1, 16.0, 0.02),
]  # fmt: skip


@pytest.fixture
def frame():
    made = pd.DataFrame(ROWS, columns=["way", "plant", "seconds", "deviation"])
    return made.assign(regime="noise", error=0.02, floor=0.01, covered=NOT_YET, design=0.1)


def test_motion_until_a_target_is_that_of_each_plant(frame):
    found = loop.reached(frame, 0.0075)["noise"]
    assert found["quick"].tolist() == [8.0, 16.0] and found["slow"].tolist() == [16.0, np.inf]
    assert loop._ranked(loop.reached(frame, 0.0075)) == [("quick", 16.0), ("slow", np.inf)]


def test_the_table_says_never_where_a_target_is_not_reached(frame):
    shown = loop.table(frame, "noise", (0.0075,))
    assert shown["s to σ ≤ 0.75 %"].to_dict() == {"quick": "16 (8 – 16)", "slow": "never (16 – never)"}
    assert shown["error over the floor after 16 s"].tolist() == ["2", "2"]
    assert "95 % intervals that hold [%]" not in shown


def test_the_page_is_written_and_what_is_there_is_kept(tmp_path, monkeypatch):
    options = ["--arm", "planar2", "--plants", "1", "--count", "2", "--scale", "tiny"]
    options += ["--regimes", "noise", "--folder", str(tmp_path)]
    assert loop.main(options) == 0
    page, rows = (tmp_path / "loop.md").read_text(), pd.read_csv(tmp_path / "loop.csv")
    assert list(rows.groupby("way").size()[list(loop.WAYS)]) == [2] * len(loop.WAYS)
    assert "--arm planar2 --plants 1 --count 2" in page and "## Noise" in page and "## Misfit" not in page
    ends = rows[rows.seconds == 16].set_index("way").deviation
    assert ends[loop.VARIANCE] < ends[loop.RANDOM]
    monkeypatch.setattr(loop.Study, "rows", None)  # nothing is made again
    assert loop.main([*options, "--kept"]) == 0
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "loop.csv"), rows)
