"""The tutorials run on small settings and show what they gave; the API reference has every public name."""

import json
import re
from base64 import b64decode
from pathlib import Path

import matplotlib
import pytest

import sidegan
from sidegan.gan.settings import ExactPhysics, Refresh, Reward, Weights
from sidegan.seeding import Seeds

TUTORIALS = Path(__file__).parents[1] / "docs" / "tutorials"
LARGEST = 100_000  # bytes of a picture

# What takes the place of the settings at the top, and what must be printed then.
VANILLA = {"variant": "Vanilla", "weights": {"adversarial": 1}, "epochs": 2, "steps": 2, "width": 16}
SURROGATES = {"samples": 400, "epochs": 2, "width": 16, "negatives": {"vanilla": VANILLA}}
TRAINING = {"epochs": 2, "steps": 2, "width": 16, "fitness_start": 1}
SMALL = {
    "your_arm": ("count = 2", "set/trajectories/2.csv"),
    "recordings": ("count = 2", "the torque of joint_2 runs against the description"),
    "paper": (
        f"robot, seeds_count, surrogates, training = 'planar2', 60, {SURROGATES}, {TRAINING}",
        "60 of 60 are valid",
    ),
}


def cells(name: str) -> list[dict]:
    notebook = json.loads((TUTORIALS / f"{name}.ipynb").read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def test_every_tutorial_is_tested():
    assert {path.stem for path in TUTORIALS.glob("*.ipynb")} == SMALL.keys()


@pytest.mark.parametrize("name", SMALL)
def test_tutorials_are_committed_with_outputs_in_order(name):
    assert [cell["execution_count"] for cell in cells(name)] == list(range(1, len(cells(name)) + 1))
    outputs = [output for cell in cells(name) for output in cell["outputs"]]
    assert not [output for output in outputs if output["output_type"] == "error"]
    pictures = ["".join(output.get("data", {}).get("image/png", "")) for output in outputs]
    assert any(pictures) and max(len(b64decode(picture)) for picture in pictures) <= LARGEST


@pytest.mark.parametrize("name", SMALL)
def test_tutorials_run(name, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")
    settings, printed = SMALL[name]
    space = {"__name__": "__main__"}
    for k, cell in enumerate(cells(name)):
        source = settings if "parameters" in cell["metadata"].get("tags", []) else "".join(cell["source"])
        exec(compile(source, f"{name}[{k + 1}]", "exec"), space)
    assert printed in capsys.readouterr().out


def test_the_reference_lists_every_public_name_and_the_groups_of_their_settings():
    page = (TUTORIALS.parent / "api" / "index.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: sidegan\.(\w+)$", page, re.MULTILINE)) == sorted(sidegan.__all__)
    deeper = set(re.findall(r"^::: sidegan\.[\w.]+\.(\w+)$", page, re.MULTILINE))
    assert {kind.__name__ for kind in (Seeds, Weights, Refresh, Reward, ExactPhysics)} <= deeper
