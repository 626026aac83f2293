"""What documents show is so: tutorials and examples run, decisions quote the settings."""

import json
import re
import runpy
from base64 import b64decode
from pathlib import Path

import matplotlib
import pytest
import yaml
from omegaconf import OmegaConf

import sidegan
from sidegan.design.excitation import condition_of
from sidegan.gan.settings import ExactPhysics, GeneratorSettings, Refresh, Reward, Weights
from sidegan.seeding import Seeds
from tests.tiny import composed

DOCS = Path(__file__).parents[1] / "docs"
EXAMPLES, TUTORIALS = DOCS.parent / "examples", DOCS / "tutorials"
LARGEST = 100_000  # bytes of a picture

# What makes the settings at the top smaller, and what must be printed then.
SMALLER = {"epochs": 2, "steps": 2, "generator": {"width": 16}}
VANILLA = {"_target_": "sidegan.gan.variants.Vanilla", "weights": {"adversarial": 1}, **SMALLER}
SURROGATES = {"samples": 400, "epochs": 2, "width": 16, "negatives": {"vanilla": VANILLA}}
SMALL = {
    "your_arm": ("count = 2", "set/trajectories/2.csv"),
    "recordings": ("count = 2", "the torque of joint_2 runs against the description"),
    "paper": (
        f"robot, seeds_count = 'planar2', 60\nsurrogates |= {SURROGATES}\ntraining |= {SMALLER}",
        "60 of 60 are valid",
    ),
}
PRINTED = {
    "regressor": "43 base parameters",
    "validity": "trajectory 1: valid\ntrajectory 2: position of joint_2",
    "excitation_set": "3 trajectories, condition number ",
    "online": "trajectory 4: the condition number of all so far is ",
    "identify_table": "nMSE of what was held out: {'shoulder': ",
}
# A value and the setting that a comment behind it names: "0.2<!-- seeds/gradient: reserve -->".
DECISIONS = (DOCS / "decisions.md").read_text(encoding="utf-8")
QUOTED = re.compile(r"([\w.]+)`?( %)?<!-- ([\w= ]+): ([\w.\[\]]+) -->")


def cells(name: str) -> list[dict]:
    notebook = json.loads((TUTORIALS / f"{name}.ipynb").read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def test_every_document_is_tested():
    assert {path.stem for path in TUTORIALS.glob("*.ipynb")} == SMALL.keys()
    lines = {path.stem: path.read_text("utf-8").splitlines() for path in EXAMPLES.glob("*.py")}
    assert lines.keys() == PRINTED.keys() and max(map(len, lines.values())) < 30


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
        source = "".join(cell["source"])
        if "parameters" in cell["metadata"].get("tags", []):
            source += f"\n{settings}"
        exec(compile(source, f"{name}[{k + 1}]", "exec"), space)
    assert printed in capsys.readouterr().out


def test_the_reference_lists_every_public_name_and_the_groups_of_their_settings():
    page = (DOCS / "api" / "index.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: sidegan\.(\w+)$", page, re.MULTILINE)) == sorted(sidegan.__all__)
    deeper = set(re.findall(r"^::: sidegan\.[\w.]+\.(\w+)$", page, re.MULTILINE))
    kinds = Seeds, Weights, GeneratorSettings, Refresh, Reward, ExactPhysics
    assert {kind.__name__ for kind in kinds} <= deeper


@pytest.mark.parametrize("name", PRINTED)
def test_examples_run(name, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", [f"{name}.py"])
    runpy.run_path(str(EXAMPLES / f"{name}.py"))
    assert PRINTED[name] in capsys.readouterr().out


def test_the_online_example_prints_the_condition_number_and_not_its_logarithm(capsys):
    ran = runpy.run_path(str(EXAMPLES / "online.py"))
    subspace = ran["problem"].body.base.subspace
    expected = condition_of(subspace.T @ ran["aim"].next().prior @ subspace)
    assert float(capsys.readouterr().out.split()[-1]) == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize(("value", "percent", "command", "setting"), QUOTED.findall(DECISIONS))
def test_decisions_quote_the_current_settings(value, percent, command, setting):
    current = OmegaConf.select(composed(*f"+experiment={command}".split()), setting)
    assert (100 * current if percent else current) == yaml.safe_load(value)
