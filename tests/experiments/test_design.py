"""The experiment of designs: from a library or from a generator, each made by a stage of its own."""

import pytest

from sidegan.errors import ArtifactError, ConfigError
from sidegan.pipeline.run import run_stages
from tests.tiny import tiny


@pytest.mark.parametrize("begin", ["library", "generator"])
def test_designs_start_from_either(outputs, tmp_path, begin):
    config = tiny(f"outputs={outputs}", f"design.starts={begin}", experiment="design")
    run_stages(config, tmp_path, "design")
    assert (tmp_path / "trajectories").is_dir() and any((tmp_path / "trajectories").iterdir())


def test_a_generator_that_is_not_there_is_asked_for(tmp_path):
    options = (f"outputs={tmp_path}", "design.starts=generator", "stages=[table]")
    with pytest.raises(ArtifactError, match="run stage generator first"):
        run_stages(tiny(*options, experiment="design"), tmp_path / "run", "design")
    with pytest.raises(ConfigError, match="starts"):
        tiny("design.starts=chance", experiment="design")
