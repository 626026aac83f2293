"""The experiment of designs: from a library or from a generator, each made by a stage of its own."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from experiments.design import _SINGULAR, Answer, Question, _meant, _row
from sidegan.designer import Aim, Designer, Situation
from sidegan.errors import ArtifactError, ConfigError, ShapeError
from sidegan.identification import TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.known import Known
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.schema import Asked
from sidegan.validity import Constraints
from tests.tiny import tiny


@pytest.mark.parametrize("begin", ["library", "generator"])
def test_designs_start_from_either(outputs, tmp_path, begin):
    config = tiny(f"outputs={outputs}", f"design.starts={begin}", experiment="design")
    run_stages(config, tmp_path, "design")
    assert (tmp_path / "trajectories").is_dir() and any((tmp_path / "trajectories").iterdir())


def test_every_part_of_a_situation_can_be_asked_for_in_words():
    said = "{name: fast, home: [0.1, 0.2], velocity: 0.5, torque: 0.9, period: 8, clearance: 0.01"
    said += ", noise: [1, 2]}"
    asked = tiny(f"design.ask={said}", experiment="design").design.ask
    assert asked == Asked("fast", [0.1, 0.2], None, 0.5, 0.9, 8.0, 0.01, noise=[1.0, 2.0])
    words = "{aim: variance, links: {link_2: 1}, regions: [{plane: {normal: [0, 0, 1], offset: -1}}]}"
    asked = tiny(f"design.ask={words}", experiment="design").design.ask
    assert asked.links == {"link_2": 1} and len(asked.regions) == 1
    assert tiny(experiment="design").design.ask == Asked()


def test_a_generator_that_is_not_there_is_asked_for(tmp_path):
    options = (f"outputs={tmp_path}", "design.starts=generator", "stages=[table]")
    with pytest.raises(ArtifactError, match="run stage generator first"):
        run_stages(tiny(*options, experiment="design"), tmp_path / "run", "design")
    with pytest.raises(ConfigError, match="starts"):
        tiny("design.starts=chance", experiment="design")


@pytest.fixture(scope="module")
def designer(planar):
    settings = tiny(experiment="design").designer
    return Designer(Constraints(planar), Trajectory(2, 3, 8.0), settings)


@pytest.fixture(scope="module")
def known(planar):
    """A model with correlated errors, at 400 Hz."""
    model = TorqueModel(RigidBody(planar))
    rows = torch.randn(200, model.count, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    covariance = torch.linalg.inv(rows.T @ rows)
    nothing, certainty = torch.zeros(model.count).double(), torch.tensor([2.0, 0.5]).double()
    return Known(model, nothing, torch.ones(2).double(), 1, nothing, covariance, certainty, 400.0)


def test_a_design_is_asked_for_beside_what_an_identification_left_uncertain(known):
    """The prior is that on the whole model, friction included, and noise is for the designer's rate."""
    body = known.model.body
    _, aim = _meant(Asked(aim="determinant"), known, body, 100.0)
    expected = torch.linalg.inv(known.covariance)
    np.testing.assert_allclose(aim.prior, expected.numpy(), rtol=1e-6, atol=1e-6 * float(expected.max()))
    assert aim.model is known.model
    assert aim.noise == pytest.approx([0.25, 1.0])
    assert _meant(Asked(aim="variance", noise=[3.0, 3.0]), known, body, 100.0)[1].noise == [3.0, 3.0]
    alone = _meant(Asked(), None, body, 100.0)[1]
    assert alone.prior is None and alone.model is None


def test_what_an_identification_is_certain_of_stays_finite(known):
    certain = known.covariance.clone()
    certain[3], certain[:, 3] = 0.0, 0.0
    aim = _meant(Asked(aim="determinant"), replace(known, covariance=certain), known.model.body, 100.0)[1]
    assert np.isfinite(aim.prior).all() and aim.prior[3, 3] > 1e6
    aim.numbers(known.model.body)


def test_what_is_known_has_no_part_in_a_condition_number(known):
    with pytest.raises(ConfigError, match="ask for determinant or variance"):
        _meant(Asked(aim="condition"), known, known.model.body, 100.0)


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside a model"])
def test_a_design_for_prediction_says_how_uncertain_torques_stay(known, designer, beside):
    body = designer.numbers.constraints.body
    asked = Asked(aim="prediction", noise=[0.5, 0.5])
    place, aim = _meant(asked, known if beside else None, body, 100.0)
    answer = Answer(Question("one", asked, place, aim), designer.ask(place, aim, 60), 100.0)
    words = _row(answer)["torques uncertain by"]
    after, *before = (float(x.rstrip("%")) for x in words.split(", before "))
    assert 0 < after < (before[0] if beside else 100.0)
    more = Answer(answer.question, answer.design, 400.0)  # four times as many samples
    assert float(_row(more)["torques uncertain by"].split("%")[0]) < after


def test_a_folder_without_a_model_is_told(outputs, tmp_path):
    config = tiny(f"outputs={outputs}", f"known={tmp_path}", "stages=[table]", experiment="design")
    with pytest.raises(ConfigError, match="expected the folder of a run"):
        run_stages(config, tmp_path / "run", "design")


def refused(tmp_path, *options, content=None):
    """The message of a question that is refused before anything is made."""
    file = tmp_path / "situations.yaml"
    if content is not None:
        file.write_text(content)
        options = (*options, f"design.file={file}")
    config = tiny(f"outputs={tmp_path}", *options, experiment="design")
    with pytest.raises((ConfigError, ShapeError)) as told:
        run_stages(config, tmp_path / "run", "design")
    assert not [*tmp_path.glob("starts*")] and "\n" not in str(told.value)
    return str(told.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "[{velocty: 1}]",
            "situations[0].velocty: there is no such setting; did you mean situations[0].velocity?",
        ),
        ("a: [1", "situations.yaml: while parsing"),
        ("{}", "holds no list of situations"),
        ("[{name: one}, {name: one}]", "has situations of one name"),
        ("[{}, {period: 0.05}]", "situation-2: period is 0.05 s, expected 0.6 or more: tables of 100 Hz"),
        ("[{name: far, home: [0, 90]}]", "far: home has 90 for elbow"),
        ("[{name: far, home: [0, 1, 2]}]", "far: home [0.0, 1.0, 2.0] must be 2 finite joint positions"),
    ],
)
def test_questions_are_read_before_anything_is_made(tmp_path, content, message):
    assert message in refused(tmp_path, content=content)


def test_a_file_of_questions_that_is_not_there_is_told_in_a_line(tmp_path):
    told = refused(tmp_path, f"design.file={tmp_path}/none.yaml")
    assert told == f"there is no file design.file={tmp_path}/none.yaml"


def test_what_is_proven_but_tells_nothing_is_no_design():
    place, aim = Situation(), Aim()
    design = SimpleNamespace(
        coefficients=torch.zeros(2, 3, 2), criteria=SimpleNamespace(condition=math.inf), blocked=()
    )
    answer = Answer(Question("still", Asked(), place, aim), design, 100.0)
    assert answer.blocked == (_SINGULAR,)
    known = Answer(Question("still", Asked(), place, Aim("determinant", np.eye(4))), design, 100.0)
    assert known.blocked == ()
