"""The page on the designer: its situations, its independent check, and that it is written."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks import design
from benchmarks.independent import Robot, check_file
from benchmarks.setting import Setting
from benchmarks.situations import MIXES, Draw
from sidegan.base.storage import write_bytes
from sidegan.controllers import Course, csv_text
from sidegan.designer import Situation
from sidegan.validity import Box, Plane

pytest.importorskip("numba")

DOCS = Path(design.__file__).parents[1] / "docs"
SITUATION = Situation(None, [Box((0.4, 0.2, 0.3), (0.6, 0.5, 0.7)), Plane((1.0, 0.0, 0.0), -0.8)], 0.8, 0.7)


@pytest.fixture(scope="module")
def problem():
    return Setting(quick=True).problem


@pytest.fixture(scope="module")
def answer(problem):
    return design.Page(Setting(quick=True), 8, 9).bench.designer(starts=False).ask(SITUATION, evaluations=60)


def test_situations_are_the_same_for_a_seed_and_leave_room_at_home(problem):
    one, again, other = (Draw(problem, seed).mixed(1) for seed in (5, 5, 6))
    assert one == again != other and len(one) == len(MIXES)
    draw = Draw(problem, 7)
    for situation in [*one, *draw.several(2)]:
        scene = draw.numbers.scene(situation)
        assert draw.prover.prove(scene, np.zeros_like(scene.size)).margins.min() >= 0
    boxes = [sum(isinstance(x, Box) for x in one.regions) for one in Draw(problem, 7).several(3)]
    assert min(boxes) >= 3 and max(boxes) <= 5


def test_what_is_proven_is_valid_to_others(answer):
    found = design.independent(answer)
    assert found["valid"] and found["colliding"] == 0 and found["distance"] >= 0
    assert 0.5 < found["velocity"] <= 1 and found["consistent"] < 1e-3


def test_others_notice_what_is_in_the_way(answer, tmp_path):
    arm, family = answer.numbers.arm, answer.trajectory
    motion = family.roll_out(answer.coefficients[None], family.times(100.0))
    write_bytes(tmp_path / "1.csv", csv_text(Course.of(arm.joint_names, motion)).encode())
    facts = design.facts_of(answer)
    whole = check_file(Robot(arm.urdf, arm.joint_names, facts), tmp_path / "1.csv")
    assert whole["colliding"] == 0 and whole["distance"] >= 0
    wide = {"lower": (-1, -1, 0.6), "upper": (1, 1, 2), "spared": []}
    hit = check_file(Robot(arm.urdf, arm.joint_names, replace(facts, boxes=[wide])), tmp_path / "1.csv")
    assert hit["colliding"] > 0 and not hit["valid"] and "box 0" in hit["pair"]
    near = {"normal": (1.0, 0.0, 0.0), "offset": -0.1, "spared": []}
    beyond = check_file(Robot(arm.urdf, arm.joint_names, replace(facts, planes=[near])), tmp_path / "1.csv")
    assert beyond["distance"] < 0 and not beyond["valid"]
    slow = {"velocity": dict.fromkeys(arm.joint_names, 0.1)}
    fast = check_file(Robot(arm.urdf, arm.joint_names, replace(facts, limits=slow)), tmp_path / "1.csv")
    assert fast["velocity"] > 1 and not fast["valid"]


def test_the_page_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(design, "_DEADLINES", (100,))
    assert design.main(["--small", "--count", "8", "--folder", str(tmp_path)]) == 0
    page = (tmp_path / "design.md").read_text()
    assert "## Mixed" in page and "## Several obstacles" in page and "are valid.**" in page
    assert (tmp_path / "design.csv").read_text().count("\n") == 1 + 5 * (8 + 2)


def test_the_page_on_the_generator_has_the_numbers_of_the_measurement():
    """Its comparison is that of docs/design.csv, row by row."""
    frame = pd.read_csv(DOCS / "design.csv")
    frame["condition"] = frame.condition.fillna(np.inf)
    text = (DOCS / "conditional.md").read_text(encoding="utf-8").split("## The comparison")[1]
    names = {"mixed": "**Mixed**", "several obstacles": "**Several obstacles**"}
    checked = 0
    for group, heading in names.items():
        some = frame[frame.group == group]
        lines = text.split(heading)[1].split("The nearest")[0].splitlines()
        for cells in ([x.strip() for x in line.split("|")[1:-1]] for line in lines if line[:2] == "| "):
            if not cells[0].isdigit():
                continue
            for who, cell in zip((design.GENERATOR, design.LIBRARY, design.RANDOM), cells[1:]):
                part = some[(some.who == who) & (some.deadline == int(cells[0]))].condition
                shown = [
                    float(x.replace("—", "inf").replace(",", "")) for x in re.split(r"[ (–)]+", cell)[:3]
                ]
                expected = [np.quantile(part, q, method="lower") for q in (0.5, 0.1, 0.9)]
                assert shown == pytest.approx(expected, rel=1e-4, abs=0.51)  # the file has five digits
                checked += 1
    assert checked == 2 * 5 * 3
