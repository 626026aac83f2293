"""The starts of an arm, made once."""

from dataclasses import replace

import numpy as np

from sidegan.base.parallel import Report
from sidegan.designer.designer import Design, Designer
from sidegan.designer.scene import ArmNumbers
from sidegan.designer.settings import DesignerSettings
from sidegan.designer.situation import Situation
from sidegan.designer.starts import Probes, Starts, effort_of
from sidegan.errors import InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_TRIES = 200  # situations that are drawn for one where the arm can rest
_SLOWEST, _WEAKEST = 0.3, 0.5  # shares of velocity and torque limits
_AT_EASE = 0.4  # share of the situations with all of the limits


def make_starts(
    constraints: Constraints,
    trajectory: Trajectory,
    settings: DesignerSettings,
    seed: np.random.SeedSequence,
    report: Report = lambda done, total: None,
) -> Starts:
    """Optimised trajectories of random situations: homes, rooms and efforts; the same for a seed.

    Raises:
        InfeasibleError: when there is hardly any situation in which the arm can rest and move.
    """
    library = settings.library
    designer = Designer(constraints, trajectory, replace(settings, patience=library.steps))
    random = np.random.default_rng(seed)
    found: list[Design] = []
    tries = 0
    while len(found) < library.count:
        tries += 1
        if tries > _TRIES * (1 + len(found)):
            raise InfeasibleError(
                f"of {tries} situations drawn for {constraints.arm.name}, {len(found)} let it rest and move"
            )
        situation = _draw(designer.numbers, designer.probes, settings, random, plain=not found)
        design = designer.ask(situation, evaluations=library.steps)
        if design.coefficients is not None and np.isfinite(design.criteria.condition):
            found.append(design)
            report(len(found), library.count)
    return _kept(designer, found)


def _draw(
    numbers: ArmNumbers,
    probes: Probes,
    settings: DesignerSettings,
    random: np.random.Generator,
    plain: bool,
) -> Situation:
    """A situation at random; the plain one has nothing special."""
    if plain:
        return Situation()
    usual = np.array(numbers.trajectory.home)
    way = settings.library.homes * random.uniform(-1, 1, len(usual))
    home = usual + np.where(way > 0, way * (numbers.upper - usual), -way * (numbers.lower - usual))
    regions = probes.draw(random) if random.random() < settings.library.rooms else []
    velocity, torque = 1.0, 1.0
    if random.random() > _AT_EASE:
        velocity, torque = random.uniform(_SLOWEST, 1.0), random.uniform(_WEAKEST, 1.0)
    return Situation(home.tolist(), regions, velocity, torque)


def _kept(designer: Designer, found: list[Design]) -> Starts:
    """What is kept of designs."""
    scenes = [design.scene for design in found if design.scene is not None]
    own = designer.numbers.constraints.regions
    return Starts(
        home=np.stack([scene.home for scene in scenes]),
        felt=np.stack([designer.probes.feel((*own, *scene.situation.regions)) for scene in scenes]),
        effort=np.stack([effort_of(scene) for scene in scenes]),
        coefficients=np.stack(
            [x.coefficients.flatten(1).numpy() for x in found if x.coefficients is not None]
        ),
        goal=np.array([np.log(design.criteria.condition) for design in found]),
    )
