"""Settings that cannot be: each kind of value in its wrong place, and commands that cannot be read."""

import contextlib
import io
import logging
import sys
from collections.abc import Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from random import Random
from typing import Any

import yaml
from omegaconf import OmegaConf

from benchmarks.hostile.case import Case
from sidegan.base.typed import build
from sidegan.errors import ConfigError
from sidegan.pipeline.run import composed, main
from sidegan.pipeline.settings import Config

_EXPERIMENTS = {
    "exp1": 90,
    "identify": 50,
    "beyond": 40,
    "design": 40,
}  # settings of each that are spoilt
_NONE = "none"  # no experiment is given
_WRONG: dict[type, tuple[Any, ...]] = {
    bool: ("maybe", 3),
    int: ("many", -(10**30), 2.5, True),
    float: (float("nan"), float("inf"), 1e300, -1e300, "fast", True),
    str: (7, ["a"]),
    list: ("x", {"a": 1}),
    type(None): ({"a": 1}, [[]]),
}
_COMMANDS: dict[str, list[str]] = yaml.safe_load(
    Path(__file__).with_name("commands.yaml").read_text(encoding="utf-8")
)


def cases() -> Iterator[Case]:
    """All of them."""
    for experiment, count in _EXPERIMENTS.items():
        for path, value in _spoilt(experiment, count):
            name = f"setting: {'.'.join(map(str, path))}={value!r} of {experiment}"
            yield Case(name, partial(_one_setting, experiment, path, value))
    for experiment, commands in _COMMANDS.items():
        for words in commands:
            words = words if experiment == _NONE else f"+experiment={experiment} {words}"
            yield Case(f"command: {words or 'nothing'}", partial(command, words))


@cache
def _values(experiment: str) -> dict[str, Any]:
    """Settings of an experiment as plain values."""
    plain: Any = OmegaConf.to_container(OmegaConf.create(composed(f"+experiment={experiment}").plain()))
    return plain


def _spoilt(experiment: str, count: int) -> list[tuple[tuple[str, ...], Any]]:
    """Some settings, each with a value of a wrong type or size; the same every time."""
    leaves = [
        (path, value)
        for path, old in _leaves(_values(experiment))
        for value in _WRONG[type(old)]
        if not (path[-1] in _BY_NAME and isinstance(value, dict))
    ]
    return Random(experiment).sample(leaves, count)


def _leaves(values: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, (*path, key))
        elif key not in _FREE:
            yield (*path, key), value


_FREE = {"publish", "topic"}  # may be any text, or null
# Numbers by names of joints or links, which only the arm tells from wrong ones: commands have some.
_BY_NAME = {"acceleration", "args", "effort", "jerk", "links", "locked", "position", "settings", "velocity"}


def _one_setting(experiment: str, path: tuple[str, ...], value: Any, folder: Path) -> None:
    def put(values: Any, rest: tuple[str, ...]) -> Any:
        return value if not rest else {**values, rest[0]: put(values[rest[0]], rest[1:])}

    build(Config, put(_values(experiment), path))


def command(words: str, folder: Path) -> None:
    """The command with these words, in a folder of its own; raises what it prints.

    Raises:
        ConfigError: with the one line of a refusal.
        AssertionError: when it prints anything else.
    """
    said = io.StringIO()
    arguments = [f"outputs={folder}", "tracking=off", *words.split()]
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said), contextlib.chdir(folder):
        sys.argv = ["run", *arguments]
        try:
            code = main()
        except SystemExit as stopped:
            code = int(stopped.code or 0)
        finally:
            logging.shutdown()
    lines = [line for line in said.getvalue().splitlines() if "error: " in line or "Traceback" in line]
    if code == 0:
        return
    if len(lines) != 1 or "Traceback" in lines[0]:
        raise AssertionError(f"exit code {code}: {said.getvalue()[-300:]}")
    raise ConfigError(lines[0].partition("error: ")[2])
