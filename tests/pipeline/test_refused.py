"""What is refused before any work: settings, arms, recordings and commands, each by its own name."""

import re
import sys

import pandas as pd
import pytest

from sidegan.errors import ArtifactError, ConfigError, InfeasibleError, RecordingError, RobotError
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.settings import validate
from tests import tiny
from tests.pipeline.test_identify import write

REGIONS = "workspace.regions=[{}]".format
RECORDED = "recordings=[FOLDER/a.csv]"
SETTINGS = [
    ("reproduction", "seeds.count=${scale.nothing}", "seeds.count: "),
    ("reproduction", "seeds.method=paper", "choose it by seeds=paper"),
    ("reproduction", "seeds=paper seeds.method=gradient", "choose it by seeds=gradient"),
    ("reproduction", "tracking=htp://host", "tracking is 'htp://host', expected auto, local, off"),
    ("reproduction", "trainer.accelerator=npu", "trainer.accelerator is 'npu', expected"),
    ("reproduction", "trainer.accelerator=gpu trainer.devices=[99]", "'devices': [99]}: "),
    ("reproduction", "stages=[seeds,gan,seeds]", "expected each once"),
    ("reproduction", "long.harmonics=[3,3]", "long.harmonics is [3, 3], expected one or more, each once"),
    ("reproduction", "long.harmonics=[]", "long.harmonics is [], expected one or more, each once"),
    ("reproduction", "stages=[seed]", "stages: there is no stage 'seed', expected some of seeds, surrogates"),
    ("reproduction", "stages=[]", "there is nothing to run: give +experiment=…"),
    ("reproduction", "trainings=[0,0]", "trainings is [0, 0], expected one or more, each once"),
    ("reproduction", "gan=eigen", "condition ours does not train diagonal, vanilla; the page"),
    ("reproduction", "identification.noise.state=true", "verdicts need expected errors"),
    ("reproduction", "subset=41", "subset is 41, expected at most seeds.count = 40"),
    ("reproduction", "discussion.sizes=[50]", "discussion.sizes has 50, expected at most seeds.count = 40"),
    ("reproduction", "selection.count=41", "selection.count is 41, expected at most seeds.count = 40"),
    ("reproduction", "library.count=5", "selection.count is 6, expected at most library.count = 5"),
    ("reproduction", "discussion.bandwidths=[]", "discussion.bandwidths is [], expected one or more"),
    ("reproduction", "discussion.trainings=[0,0]", "discussion.trainings is [0, 0], expected one or more"),
    ("reproduction", "discussion.sizes=[1]", "discussion.sizes is 1, expected two or more"),
    ("training", "seeds.count=1", "seeds.count is 1, expected two or more"),
    ("training", "subset=1", "subset is 1, expected two or more"),
    ("training", "evaluation=1", "evaluation is 1, expected two or more"),
    ("exp1", "identification.noise.level=0", "identification.noise has no torque noise"),
    ("exp1", "plants.sensors.cutoff=300", "sensors.cutoff is 300, expected less than half of plant.rate=250"),
    ("exp1", "plants.sensors.rate=150", "sensors.rate is 150, expected a divisor of plant.rate=250"),
    ("generality", "arms=[]", "arms is [], expected one or more"),
    ("reproduction", "seeds.samples=6", "seeds.samples is 6, expected more than two per period"),
    ("reproduction", "long.samples=24", "long.samples is 24, expected more than two per period"),
    ("reproduction", "identification.rate=0.5", "identification.rate is 0.5 Hz, expected more than twice"),
    ("reproduction", "parallel.scheduler=here", "expected an address like tcp://host:8786"),
    ("exp1", "seed=${seed}", "seed: Recursive interpolation detected"),
    ("exp1", "seed=${eval:1}", "seed: Unsupported interpolation type eval"),
    ("exp1", "long.period=1e300", "long.period is 1e+300, expected a number ≤"),
    ("exp1", "library.count=1000000000000", "library.count is 1000000000000, expected a whole number"),
    ("exp1", REGIONS("{plane:{normal:[0,0,0],offset:1}}"), "a plane needs a non-zero normal"),
    ("exp1", REGIONS("{}"), "regions[0]: a region is exactly one of plane, box, sphere"),
    ("exp1", REGIONS("{spere:{radius:1}}"), "did you mean workspace.regions[0].sphere?"),
    ("exp1", REGIONS("{mesh:{file:FOLDER/broken.stl}}"), "broken.stl cannot be read"),
    ("exp1", "table=nowhere.tables", "table is 'nowhere.tables': there is no such module"),
    ("exp1", "table=''", "table is '': there is no such module"),
    ("exp1", "table=json", "table is 'json': it has no function collect and no present"),
    ("excite", "goal.objective=condition known=FOLDER", "goal.objective=condition uses no model"),
    ("excite", "controllers.formats=[urscript]", "urscript, which moves 6 revolute joints; planar2 has 2"),
    ("excite", "controllers.rate=1.8", "controllers.rate is 1.8 Hz, expected 7.5 or more: 20 points per per"),
    ("excite", "controllers.speed=1e-12", "speed=1e-12 takes 8e+12 s, 2e+14 samples with controllers.rate"),
    ("excite", "controllers.pause=1e5 controllers.rate=1e3", "pause takes 1e+05 s, 1e+08 samples with contr"),
    ("excite", "controllers.start=[0,0,0]", "[0.0, 0.0, 0.0], expected the positions of 2 joints"),
    ("excite", "controllers.coupling={elbow:{hand:1}}", "controllers.coupling names hand; the arm has"),
    ("excite", "controllers.coupling={elbow:{shoulder:1}}", "controllers.coupling has no inverse"),
    ("excite", "controllers.start=[0,90]", "controllers.start has 90 for elbow, whose range is"),
    ("excite", "trajectory.home=[0,90] robot.effort=0.5", "trajectory.home has 90 for elbow, whose range"),
    ("excite", "known=FOLDER", "expected the folder of a run of +experiment=identify"),
    ("excite", "goal.objective=[hand]", "goal.objective names hand, expected some of the links"),
    ("identify", "+workspace=free", "workspace and trajectory are used together"),
    ("identify", "stages=[identify]", "recordings is empty"),
    ("identify", "robot=unnamed recordings=[FOLDER/a.csv]", "which arm was recorded? robot.name="),
    ("identify", "robot=unnamed stages=[check]", "which arm was recorded? robot.name="),
    ("identify", "recordings=[a.csv] validation=[a.csv]", "would not be held out"),
    ("identify", "recordings=[a.csv,a.csv]", "recordings has a.csv twice"),
    ("identify", "recordings=[{position:a,effort:b}] validation=[{position:c,torque:b}]", "validation has b"),
    ("identify", "recordings=[{position:a}]", "recordings[0]: {position: a} has no effort"),
    ("payload", "recordings=[FOLDER/a.csv]", "loaded is empty, expected recordings with the load"),
    ("gains", "recordings=[FOLDER/a.csv] loaded=[FOLDER/a.csv]", "load.mass is 0, expected the mass"),
]
OTHERS = [
    (RobotError, "exp1", "robot.limits.velocity={a:1}", "has no joint 'a' of robot.limits.velocity"),
    (InfeasibleError, "exp1", "trajectory.home=[0,4]", "position of elbow"),
    (InfeasibleError, "exp1", "trajectory.home=[0,3.1] stages=[seeds]", "home position"),
    (ArtifactError, "exp1", "stages=[gan]", "there is no seeds/planar2-gradient-seed0"),
    (ArtifactError, "exp1", "stages=[selection]", "there is no random/planar2-random-seed0"),
    (ArtifactError, "exp1", "stages=[table]", "long/planar2-5-32s-3h-seed0"),
    (RecordingError, "identify", "robot=kuka_lwr4 recordings=[FOLDER/a.csv]", "no column 'q3'"),
    (RecordingError, "identify", f"{RECORDED} validation=[FOLDER/x/../a.csv]", "holds samples of a.csv"),
    (RecordingError, "identify", f"{RECORDED} validation=[FOLDER/part.csv]", "holds samples of a.csv"),
    (RecordingError, "payload", "recordings=[FOLDER/a.csv] loaded=[FOLDER/part.csv]", "holds samples of a"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, planar):
    """Files that are good for one thing and not for another."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "x").mkdir()
    table = pd.read_csv(write(folder, "a.csv", planar, 0))
    table[500:700].to_csv(folder / "part.csv", index=False)
    (folder / "broken.stl").write_text("no mesh")
    return folder


@pytest.mark.parametrize(
    ("error", "experiment", "overrides", "words"), [*((ConfigError, *row) for row in SETTINGS), *OTHERS]
)
def test_invalid_settings_are_refused_before_any_work(folder, tmp_path, error, experiment, overrides, words):
    given = overrides.replace("FOLDER", str(folder)).split()
    with pytest.raises(error, match=re.escape(words)):
        config = tiny.tiny(f"outputs={tmp_path}", *given, experiment=experiment)
        run_stages(config, tmp_path / "run", "refused")
    made = {path.name for path in tmp_path.glob("[!.]*/*") if path.suffix != ".work"}
    assert not made, "work was done before it was refused"


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [("experiment", "../up", "'../up' names a folder"), ("gan", {}, "gan is empty")],
)
def test_invalid_experiment_files_are_refused(key, value, words):
    cfg = tiny.composed("+experiment=exp1")
    cfg[key] = value
    with pytest.raises(ConfigError, match=words):
        validate(cfg)


TYPO = "error: seeds.cuont: there is no such setting; did you mean seeds.count?\n"
OF_LIMITS = "robot.limits: joint_1 is not a setting of this group, which has position, velocity, accel"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("seeds.cuont=3", TYPO),
        ("+seeds.cuont=3", TYPO),
        ("sedes.count=3", "error: sedes.count: there is no such setting; did you mean seeds.count?"),
        ("sedes=paper", "error: sedes: there is no such setting; did you mean seeds?"),
        ("gan.epochs=20", "did you mean gan.vanilla.epochs or gan.eigen.epochs"),
        ("gan.limited=true", "did you mean gan.generator.limited?"),
        ("gan.generator.widht=3", "there is no such setting; did you mean gan.generator.width?"),
        ("gan.eigen.generator.limited=true", "variants share their generator; set gan.generator.limited"),
        ("gan=eigne", "Could not find 'gan/eigne'"),
        ("experiment=exp1", "use +experiment=exp1"),
        ("recordings=[a.csv]", "recordings: this is a setting of other experiments"),
        ("robot.limits={joint_1:1}", OF_LIMITS),
        ("robot={limits:{velocit:{a:1}}}", "did you mean robot.limits.velocity?"),
        ("+experiment=exp99", "Could not find 'experiment/exp99'"),
        ("seed=0,1", "To sweep over it, add --multirun"),
        ("seed==", "Error parsing override 'seed=='"),
        ("robot.name=/myärm/arm.urdf", "around the value: 'robot.name=\"/myärm/arm.urdf\"'\n"),
        ("recordings=[{position:/ä.csv}]", "around the value: 'recordings=[{position:\"/ä.csv\"}]'\n"),
    ],
)
def test_a_wrong_command_exits_with_code_2_and_one_line(command, capsys, tmp_path, arguments, words):
    assert command(*arguments.split()) == 2
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error and "_base" not in error
    assert not (tmp_path / "outputs" / "seeds").exists()


@pytest.mark.parametrize(
    ("settings", "package", "extra"),
    [
        (["seeds=paper"], "pygmo", "paper"),
        (["stages=[random,gan]"], "pytorch_lightning", "paper"),
        (["stages=[random,surrogates]"], "pytorch_lightning", "paper"),
        (["parallel.scheduler=tcp://127.0.0.1:9"], "distributed", "dask"),
    ],
)
def test_a_missing_package_is_reported_before_any_work(tmp_path, monkeypatch, settings, package, extra):
    monkeypatch.setitem(sys.modules, package, None)
    words = rf"{package} is not installed; it comes with pip install 'sidegan\[{extra}\]'"
    with pytest.raises(ConfigError, match=words):
        run_stages(tiny.tiny(f"outputs={tmp_path}", *settings), tmp_path / "run", "bare")
    assert not (tmp_path / "random").exists()
