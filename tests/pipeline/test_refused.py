"""What is refused before any work: settings, arms, recordings, commands, and what each message names."""

import sys

import pandas as pd
import pytest

from sidegan.errors import ArtifactError, ConfigError, InfeasibleError, RecordingError, RobotError
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.settings import validate
from tests import tiny
from tests.recording.files import write_moved
from tests.refusals import refused

REGIONS = "workspace.regions=[{}]".format
RECORDED = "recordings=[FOLDER/a.csv]"
SETTINGS = [  # of which experiment, what is set, and what the message names
    ("reproduction", "seeds.count=${scale.nothing}", "seeds.count: scale.nothing"),
    ("reproduction", "seeds.method=paper", "evaluations seeds=paper"),
    ("reproduction", "seeds=paper seeds.method=gradient", "reserve seeds=gradient"),
    ("reproduction", "tracking=htp://host", "tracking 'htp://host' http://host:5000"),
    ("reproduction", "trainer.accelerator=npu", "trainer.accelerator 'npu' 'gpu'"),
    ("reproduction", "trainer.accelerator=gpu trainer.devices=[99]", "trainer 'gpu' [99]"),
    ("reproduction", "stages=[seeds,gan,seeds]", "stages ['seeds', 'gan', 'seeds'] once"),
    ("reproduction", "long.harmonics=[3,3]", "long.harmonics [3, 3] once"),
    ("reproduction", "long.harmonics=[]", "long.harmonics []"),
    ("reproduction", "stages=[seed]", "stages 'seed' seeds, surrogates"),
    ("reproduction", "stages=[]", "+experiment=… stages=["),
    ("reproduction", "trainings=[0,0]", "trainings [0, 0] once"),
    ("reproduction", "gan=eigen", "ours diagonal, vanilla;"),
    ("reproduction", "identification.noise.state=true", "identification.noise.state true verdicts"),
    ("reproduction", "subset=41", "subset 41 seeds.count 40"),
    ("reproduction", "discussion.sizes=[50]", "discussion.sizes 50 seeds.count 40"),
    ("reproduction", "selection.count=41", "selection.count 41 seeds.count 40"),
    ("reproduction", "library.count=5", "selection.count 6 library.count 5"),
    ("reproduction", "discussion.bandwidths=[]", "discussion.bandwidths []"),
    ("reproduction", "discussion.trainings=[0,0]", "discussion.trainings [0, 0] once"),
    ("reproduction", "discussion.sizes=[1]", "discussion.sizes 1 two"),
    ("training", "seeds.count=1", "seeds.count 1 two"),
    ("training", "subset=1", "subset 1 two"),
    ("training", "evaluation=1", "evaluation 1 two"),
    ("generality", "evaluation=1", "evaluation 1 two"),
    ("exp1", "identification.noise.level=0", "identification.noise torque"),
    ("exp1", "plants.sensors.cutoff=300", "plants sensors.cutoff 300 plant.rate=250"),
    ("exp1", "plants.sensors.rate=150", "plants sensors.rate 150 plant.rate=250"),
    ("generality", "arms=[]", "arms []"),
    ("reproduction", "seeds.samples=6", "seeds.samples 6 trajectory.harmonics=3"),
    ("reproduction", "long.samples=24", "long.samples 24 long.harmonics=[3, 12]"),
    ("reproduction", "identification.rate=0.5", "identification.rate 0.5 0.375"),
    ("reproduction", "parallel.scheduler=here", "parallel scheduler 'here' tcp://host:8786"),
    ("exp1", "seed=${seed}", "seed: interpolation"),
    ("exp1", "seed=${eval:1}", "seed: interpolation eval"),
    ("exp1", "long.period=1e300", "long.period 1e+300 100000"),
    ("exp1", "library.count=1000000000000", "library.count 1000000000000 1,000,000,000"),
    ("exp1", REGIONS("{plane:{normal:[0,0,0],offset:1}}"), "workspace.regions[0].plane normal non-zero"),
    ("exp1", REGIONS("{}"), "workspace.regions[0] plane box sphere cylinder mesh"),
    ("exp1", REGIONS("{spere:{radius:1}}"), "workspace.regions[0].spere workspace.regions[0].sphere"),
    ("exp1", REGIONS("{mesh:{file:FOLDER/broken.stl}}"), "FOLDER/broken.stl"),
    ("exp1", "table=nowhere.tables", "table 'nowhere.tables' module"),
    ("exp1", "table=''", "table '' module"),
    ("exp1", "table=json", "table 'json' collect present"),
    ("excite", "goal.objective=condition known=FOLDER", "goal.objective=condition known="),
    ("excite", "controllers.formats=[urscript]", "controllers.formats urscript 6 revolute planar2 2"),
    ("excite", "controllers.rate=1.8", "controllers.rate 1.8 7.5 trajectory.harmonics=3"),
    ("excite", "controllers.speed=1e-12", "trajectory.period=8 controllers.speed=1e-12 controllers.rate=20"),
    ("excite", "controllers.pause=1e5 controllers.rate=1e3", "controllers.pause controllers.rate=1000 1e+08"),
    ("excite", "controllers.start=[0,0,0]", "controllers.start [0.0, 0.0, 0.0] 2 shoulder, elbow"),
    ("excite", "controllers.coupling={elbow:{hand:1}}", "controllers.coupling hand shoulder, elbow"),
    ("excite", "controllers.coupling={elbow:{shoulder:1}}", "controllers.coupling inverse"),
    ("excite", "controllers.start=[0,90]", "controllers.start 90 elbow 2.9 'controllers.start=[0, 1.571]'"),
    ("excite", "trajectory.home=[0,90] robot.effort=0.5", "90 elbow 2.9 'trajectory.home=[0, 1.571]'"),
    ("excite", "known=FOLDER", "known FOLDER +experiment=identify FOLDER/parameters.json"),
    ("excite", "goal.objective=[hand]", "goal.objective hand upper_arm, forearm goal.objective=parameters"),
    ("identify", "+workspace=free", "workspace trajectory"),
    ("identify", "stages=[identify]", "recordings 'recordings=[a.csv,b.csv]'"),
    ("identify", "robot=unnamed recordings=[FOLDER/a.csv]", "robot.name= robot=kuka_lwr4"),
    ("identify", "robot=unnamed stages=[check]", "robot.name= robot=kuka_lwr4"),
    ("identify", "recordings=[a.csv] validation=[a.csv]", "validation a.csv recordings"),
    ("identify", "recordings=[a.csv,a.csv]", "recordings a.csv twice"),
    ("identify", "recordings=[{position:a,effort:b}] validation=[{position:c,torque:b}]", "validation b,"),
    ("identify", "recordings=[{position:a}]", "recordings[0] {position: a} effort"),
    ("payload", "recordings=[FOLDER/a.csv]", "loaded 'loaded=[a.csv]'"),
    ("gains", "recordings=[FOLDER/a.csv] loaded=[FOLDER/a.csv]", "load.mass 0 kg"),
]
OTHERS = [
    (RobotError, "exp1", "robot.limits.velocity={a:1}", "planar2.urdf 'a' robot.limits.velocity shoulder"),
    (InfeasibleError, "exp1", "trajectory.home=[0,4]", "home [0.0, 4.0] position elbow"),
    (InfeasibleError, "exp1", "trajectory.home=[0,3.1] stages=[seeds]", "home [0.0, 3.1] position elbow"),
    (ArtifactError, "exp1", "stages=[gan]", "seeds/planar2-gradient-seed0"),
    (ArtifactError, "exp1", "stages=[selection]", "random/planar2-random-seed0"),
    (ArtifactError, "exp1", "stages=[table]", "long/planar2-5-32s-3h-seed0"),
    (RecordingError, "identify", "robot=kuka_lwr4 recordings=[FOLDER/a.csv]", "a.csv 'q3', 'q7';"),
    (RecordingError, "identify", f"{RECORDED} validation=[FOLDER/x/../a.csv]", "a.csv 0 29.99"),
    (RecordingError, "identify", f"{RECORDED} validation=[FOLDER/part.csv]", "part.csv a.csv 5 6.99"),
    (RecordingError, "payload", f"{RECORDED} loaded=[FOLDER/part.csv]", "part.csv a.csv 5 6.99"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, planar):
    """Files that are good for one thing and not for another."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "x").mkdir()
    table = pd.read_csv(write_moved(folder / "a.csv", planar, 0))
    table[500:700].to_csv(folder / "part.csv", index=False)
    (folder / "broken.stl").write_text("no mesh")
    return folder


@pytest.mark.parametrize(
    ("error", "experiment", "overrides", "about"), [*((ConfigError, *row) for row in SETTINGS), *OTHERS]
)
def test_invalid_settings_are_refused_before_any_work(folder, tmp_path, error, experiment, overrides, about):
    given, names = (words.replace("FOLDER", str(folder)).split() for words in (overrides, about))
    with refused(error, *names):
        config = tiny.tiny(f"outputs={tmp_path}", *given, experiment=experiment)
        run_stages(config, tmp_path / "run", "refused")
    made = {path.name for path in tmp_path.glob("[!.]*/*") if path.suffix != ".work"}
    assert not made, "work was done before it was refused"


@pytest.mark.parametrize(
    ("key", "value", "about"),
    [("experiment", "../up", "experiment '../up'"), ("gan", {}, "gan empty")],
)
def test_invalid_experiment_files_are_refused(key, value, about):
    cfg = tiny.composed("+experiment=exp1")
    cfg[key] = value
    with refused(ConfigError, *about.split()):
        validate(cfg)


@pytest.mark.parametrize(
    ("arguments", "about"),
    [
        ("seeds.cuont=3", "seeds.cuont: seeds.count?"),
        ("+seeds.cuont=3", "seeds.cuont: seeds.count?"),
        ("sedes.count=3", "sedes.count: seeds.count?"),
        ("sedes=paper", "sedes: seeds?"),
        ("gan.epochs=20", "gan.epochs: gan.vanilla.epochs gan.eigen.epochs"),
        ("gan.prediction.epochs=20", "gan.prediction: vanilla, eigen, diagonal; gan=…"),
        ("gan.limited=true", "gan.limited: gan.generator.limited?"),
        ("gan.generator.widht=3", "gan.generator.widht: gan.generator.width?"),
        ("gan.eigen.generator.limited=true", "gan.eigen.generator.limited: gan.generator.limited"),
        ("gan=eigne", "'gan/eigne'"),
        ("experiment=exp1", "+experiment=exp1"),
        ("recordings=[a.csv]", "recordings: +experiment=…"),
        ("goal.count=3", "goal.count: +experiment=…"),  # there is no file goal=… to choose
        ("~seed", "seed missing"),
        ("robot.limits={joint_1:1}", "robot.limits: joint_1 position, velocity, file"),
        ("robot={limits:{velocit:{a:1}}}", "robot.limits: velocit robot.limits.velocity?"),
        ("+experiment=exp99", "'experiment/exp99'"),
        ("seed=0,1", "'seed=0,1' --multirun"),
        ("seed==", "'seed=='"),
        ("robot.name=/myärm/arm.urdf", "'robot.name=\"/myärm/arm.urdf\"'\n"),
        ("recordings=[{position:/ä.csv}]", "'recordings=[{position:\"/ä.csv\"}]'\n"),
    ],
)
def test_a_wrong_command_exits_with_code_2_and_without_traceback(command, capsys, tmp_path, arguments, about):
    assert command(*arguments.split()) == 2
    error = capsys.readouterr().err
    assert not [name for name in ("error: ", *about.split(" ")) if name not in error], error
    assert "Traceback" not in error and "_base" not in error
    assert not (tmp_path / "outputs" / "seeds").exists()


@pytest.mark.parametrize(
    ("stage", "group", "added"), [("seeds", "seeds", True), ("excite", "controllers", False)]
)
def test_a_group_that_is_not_composed_is_to_be_added_if_it_has_files(tmp_path, stage, group, added):
    config = tiny.tiny(f"outputs={tmp_path}", f"stages=[{stage}]", experiment="identify")
    with refused(ConfigError, group) as caught:
        run_stages(config, tmp_path / "run", "refused")
    assert (f"+{group}=…" in str(caught.value)) == added


@pytest.mark.parametrize("multirun", [[], ["-m"]])
def test_an_experiment_that_has_a_number_for_a_name_is_refused(command, capsys, tmp_path, multirun):
    (tmp_path / "lab" / "experiment").mkdir(parents=True)
    file = tmp_path / "lab" / "experiment" / "own.yaml"
    file.write_text("# @package _global_\nexperiment: 7\nstages: [seeds]\n")
    assert command(*multirun, "--config-dir=lab", "+experiment=own") == 2
    shown = capsys.readouterr().err
    assert "experiment is 7" in shown and "Traceback" not in shown


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
    with refused(ConfigError, package, f"'sidegan[{extra}]'"):
        run_stages(tiny.tiny(f"outputs={tmp_path}", *settings), tmp_path / "run", "bare")
    assert not (tmp_path / "random").exists()
