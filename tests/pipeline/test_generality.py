"""One recipe on several arms: every arm's own artifacts, and one table."""

import pandas as pd
import pytest

from experiments.generality import beside_seeds
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages import measures
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import library
from tests.tiny import TINY, composed, validate

FOREIGN = "long.", "plants.", "selection.", "robot=", "seeds=", "tracking="
OWN = [override for override in TINY if not override.startswith(FOREIGN)]
GIVEN = ("+experiment=generality", "arms=[planar2]", "gan=eigen", *OWN)


def test_one_command_compares_arms(command, outputs, tmp_path):
    folder = tmp_path / "run"
    assert command(*GIVEN, f"outputs={outputs}", f"hydra.run.dir={folder}", "publish=docs") == 0
    table = pd.read_csv(folder / "arms.csv").set_index("generator")
    assert set(table.arm) == {"planar2"} and {"natural", "search-10", "seeds", "eigen"} <= set(table.index)
    assert (table.loc["seeds"].drop(["arm", "mean cosine"]).astype(float) == 1).all()
    assert float(pd.read_csv(folder / "transfer.csv").planar2[0]) == 1  # a library holds what is valid
    page = (tmp_path / "docs" / "generality.md").read_text()
    assert "arms=[planar2]" in page and "| planar2 | 2 | 0 |" in page and len(page.split()) < 600


def test_compared_arms_share_artifacts_with_single_runs(context):
    shared = GIVEN[2:]
    compared = RunContext(validate(composed(*GIVEN)), context().store, GIVEN)
    own = validate(composed("+experiment=training", "condition=gradient", "robot=planar2", *shared))
    alone = RunContext(own, context().store, ())
    found = {artifact.digest: artifact.title for artifact in measures.STAGES["arms"].artifacts(compared)}
    for artifact in (seed_set(alone), library(alone, "eigen", 0)):
        assert found[artifact.digest] == f"planar2 {artifact.title}"


def test_errors_are_relative_to_the_seeds():
    rows = {"name": ["seeds", "eigen", "eigen", "timing"], "valid_share": [None, 0.9, 1.0, 1.0]}
    rows |= {"valid": [1.0, None, None, None], "cosine": [0.0, 0.1, 0.3, 0.0]}
    rows |= {key: [2.0, 1.0, 3.0, 9.0] for key in ("condition", "distance", "rank_uncentred")}
    gains = ("gain", "gain_geometric", "gain_constant", "gain_constant_geometric")
    rows |= {key: [1.0, 4.0, 6.0, 9.0] for key in gains}
    table = beside_seeds(pd.DataFrame(rows), ["eigen"])
    assert list(table.index) == ["seeds", "eigen"] and (table.loc["seeds"].iloc[2:] == 1).all()
    eigen = table.loc["eigen"].to_dict()
    assert eigen["valid"] == pytest.approx(0.95) and eigen["mean cosine"] == pytest.approx(0.2)
    assert eigen["cond(YᵀY)"] == 1 and eigen["error, the paper's noise"] == pytest.approx(0.2)
