"""docs/lab_day.md as a person follows it: every command and script in order, MuJoCo's arm as the robot."""

import json
import re
import shlex
import sys
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

from sidegan.run import main
from tests.oracle import mujoco_torque

PAGE = Path(__file__).parents[1] / "docs" / "lab_day.md"
QUICK = ("tracking=off", "parallel.workers=1")  # neither changes a result
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def commands(text):
    """Words of each command of a block, which may go over several lines."""
    return [shlex.split(line) for line in text.replace("\\\n", " ").splitlines() if line.strip()]


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    """The folder in which all of the page was executed, and the names that its scripts left."""
    folder, names = tmp_path_factory.mktemp("lab"), {"__name__": "page"}
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    assert len(blocks) >= 8 and {kind for kind, _ in blocks} == {"sh", "python", "c"}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for kind, text in blocks:
            if kind == "c":  # tests/report/test_c_header.py compiles it
                continue
            if kind == "python":
                exec(compile(text, str(PAGE), "exec"), names)
                continue
            for words in commands(text):
                assert words[:3] == ["python", "-m", "sidegan.run"]
                patch.setattr(sys, "argv", ["run", *words[3:], *QUICK])
                assert main() == 0, " ".join(words)
    return folder / "day", names


def read(path):
    return json.loads(path.read_text())


def test_the_set_was_rehearsed_and_a_slow_set_with_approach_comes_first(day, monkeypatch):
    folder, names = day
    assert len(pd.read_csv(folder / "set" / "rehearsal.csv")) == 4
    slow = pd.read_csv(folder / "slow" / "trajectories" / "1.csv")
    assert slow.time.iloc[-1] == pytest.approx(64)
    page = PAGE.read_text(encoding="utf-8")
    assert page.index("cd day/slow") < page.index("day/set/trajectories") and "send approach" in page
    away = pd.read_parquet(folder / "slow.parquet").filter(regex="^q_").iloc[[0, -1]]
    np.testing.assert_allclose(away, [names["stands"]] * 2, atol=5e-3)  # moved first, and back
    monkeypatch.chdir(folder.parent)
    with pytest.raises(ValueError, match="does not stand"):  # without the approach
        names["reference"]("set/trajectories/1")


def test_the_controller_log_is_read(day):
    (checked,) = read(day[0] / "check" / "check.json")
    assert checked["repetitions"] == {"1": 2, "2": 2, "3": 2, "4": 2}
    assert np.array(checked["noise"]) == pytest.approx(0.2, rel=0.1)  # N·m
    assert checked["delay"]["seconds"] == pytest.approx(0.003, abs=5e-4)


def test_the_model_is_good_and_friction_comes_back(day):
    folder, _ = day
    verdict = read(folder / "model" / "verdict.json")
    assert verdict["verdict"] == "good" and verdict["validation"]["kind"] == "held out"
    assert verdict["validation"]["nmse_mean"] < 0.01
    table = pd.read_csv(folder / "model" / "parameters.csv").set_index("name")
    for j in range(1, 8):
        assert table.loc[f"fv{j}"].value == pytest.approx(2.0, rel=0.1)
        assert table.loc[f"fc{j}"].value == pytest.approx(1.0, rel=0.1)


def test_exported_models_give_the_true_torques(day):
    """Against MuJoCo's inverse dynamics of the arm that was executed."""
    folder, names = day
    plant = names["Plant"](names["arm"], names["replace"](names["IDEAL"], **names["real"])).model
    identified = mujoco.MjModel.from_xml_path(str(folder / "model" / "kuka_lwr4.xml"))
    states = np.random.default_rng(0).uniform(-1, 1, (3, 50, 7)) * np.array([1, 1, 2])[:, None, None]
    true, written = (mujoco_torque(model, *states) for model in (plant, identified))
    errors = np.array([written, names["model"].torque(*states)]) - true
    share = np.square(errors).mean(1) / true.var(0)
    assert (share < 0.05).all() and share.mean() < 0.01


def test_the_tool_is_reported(day):
    found, tool = read(day[0] / "payload" / "payload.json"), day[1]["tool"]
    sigma = found["deviation"]
    assert found["certain"] and abs(found["mass"] - tool[0]) < max(4 * sigma["mass"], 0.02)
    assert abs(found["cz"] - tool[3] / tool[0]) < max(4 * sigma["cz"], 0.01) and sigma["mass"] < 0.05


def test_a_change_overnight_shows_in_a_held_out_recording(day):
    before, after = (read(day[0] / name / "verdict.json")["validation"] for name in ("still", "changed"))
    assert before["kind"] == after["kind"] == "held out"
    grown = np.divide(after["nmse"], before["nmse"])
    assert grown.argmax() == 1 and grown[1] > 5 and np.delete(grown, 1).max() < 2
