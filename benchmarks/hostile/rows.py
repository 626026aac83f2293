"""The rows: what was counted, and what stands beside it."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from benchmarks import mutants
from benchmarks.hostile import configurations, descriptions, files, joints, kills, million, recordings
from benchmarks.hostile.case import Case, outcomes

ABOUT: dict[str, dict[str, Any]] = yaml.safe_load(Path(__file__).with_name("rows.yaml").read_text("utf-8"))
_SHOWN = 200  # characters of what went wrong
_NAMED = 20  # files that are
_KILLS, _FEW_KILLS = 100, 3
_MUTANTS, _FEW_MUTANTS = 200, 3
_WORK = Path("outputs/mutants")
_TORN = Path("outputs/kills")


@dataclass(frozen=True)
class Result:
    """What one row found: a number in its unit, and others beside it."""

    ours: float
    also: dict[str, float | str] = field(default_factory=dict)


def row(name: str, result: Result) -> dict[str, Any]:
    """A row of the table, as it is written to JSON."""
    about = dict(ABOUT[name])
    more, goal = about.pop("more"), about["goal"]
    reached = result.ours >= goal if more else result.ours <= goal
    return {"name": name, "ours": result.ours, **about, "reached": reached, "also": result.also}


def catalogue() -> list[Case]:
    """All bad inputs."""
    parts = (descriptions.cases, recordings.cases, configurations.cases, files.cases)
    return [case for part in parts for case in part()]


def bad_inputs(small: bool) -> Result:
    """Share of the catalogue that is answered as it should be; one case in fifteen of it when small."""
    cases = catalogue()[:: 15 if small else 1]
    found = outcomes(cases)
    kinds = Counter(one.how for one in found)
    also: dict[str, float | str] = {"cases": len(found), "slowest [s]": max(one.seconds for one in found)}
    also |= {f"taken as: {how}": count for how, count in kinds.items()}
    also |= {one.name: f"{one.how}: {one.words[:_SHOWN]}" for one in found if not one.answered}
    return Result(sum(one.answered for one in found) / len(found), also)


def many_joints(small: bool) -> Result:
    """Longest time until something is done with a chain of many joints, or it is refused."""
    found = joints.measured(joints.FEW if small else joints.COUNTS)
    also = {f"{n} joints [s], {memory:.2f} GB, {words}": s for n, (words, s, memory) in found.items()}
    return Result(max(seconds for _, seconds, _ in found.values()), {**also})


def million_library(small: bool) -> Result:
    """Memory for a million trajectories, along the line through a quarter of what is made and all of it."""
    whole = million.FEW if small else million.SOME
    part, all_of_it = million.measured((whole // 4, whole))
    slope = (all_of_it.memory - part.memory) / (all_of_it.trajectories - part.trajectories)
    also: dict[str, float | str] = {"million made (1), or extrapolated (0)": float(whole >= million.MANY)}
    for one in (part, all_of_it):
        also[f"{one.trajectories:,} trajectories: memory [GB]"] = one.memory
        also[f"{one.trajectories:,} trajectories: file [GB]"] = one.file
        also[f"{one.trajectories:,} trajectories: time [s]"] = one.seconds
    also["a million: time [h]"] = all_of_it.seconds / all_of_it.trajectories * million.MANY / 3600
    also["valid share of what is drawn"] = all_of_it.valid_share
    return Result(all_of_it.memory + max(0.0, slope) * (million.MANY - all_of_it.trajectories), also)


def killed(small: bool) -> Result:
    """Files that differ after kills of whole process groups at random moments, over two arms."""
    arms = ("planar2",) if small else tuple(kills.ARMS)
    work = _TORN / ("small" if small else "all")
    also: dict[str, float | str] = {}
    wrong: list[str] = []
    for arm in arms:
        found = kills.killed(arm, _FEW_KILLS if small else _KILLS // len(arms), work)
        wrong += found.unequal
        also |= {f"{arm}: kills": float(found.kills), f"{arm}: finished runs": float(found.finished)}
        also[f"{arm}: semaphores left"] = float(found.left)
        also |= {f"{arm}: kills in {stage}": float(count) for stage, count in found.stages.items()}
    return Result(len(wrong), {**also, **dict.fromkeys(wrong[:_NAMED], "unequal")})


def noticed_mutants(small: bool) -> Result:
    """Share of random small changes of the code that the tests notice."""
    frame = mutants.run(_FEW_MUTANTS if small else _MUTANTS, 0, _WORK)
    parts = frame.groupby("part").noticed.mean()
    return Result(float(frame.noticed.mean()), {str(part): float(share) for part, share in parts.items()})


ROWS: dict[str, Callable[[bool], Result]] = {
    "bad_inputs": bad_inputs,
    "joints": many_joints,
    "million_library": million_library,
    "kills": killed,
    "mutants": noticed_mutants,
}
