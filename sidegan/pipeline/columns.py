"""Columns of a comparison: the same artifacts under the run's own settings and under others."""

from dataclasses import fields
from typing import Any

from omegaconf import OmegaConf

from sidegan.errors import ConfigError
from sidegan.pipeline.schema import Column
from sidegan.pipeline.task import Task

OURS = "ours"  # the run's own settings
_WORDS = {"title", "group"}  # of a column, which are no settings of the run


def columns(task: Task) -> dict[str, Task]:
    """The task under its own settings, and under those of every column, by name."""
    others = task.cfg.columns if task.cfg.has("columns") and task.cfg.column is None else {}
    return {OURS: task} | {name: _under(task, name, column) for name, column in others.items()}


def configured() -> dict[str, str]:
    """Titles by name of all columns that the paper is compared in."""
    from sidegan.pipeline.run import CONF

    columns: Any = OmegaConf.load(CONF / "columns" / "default.yaml")
    return {str(name): str(column.title) for name, column in columns.items() if name != "defaults"}


def groups(task: Task) -> dict[str, list[str]]:
    """Names of the columns that differ in their seed set alone, by their group."""
    listed: dict[str, list[str]] = {OURS: [OURS]}
    for name, column in task.cfg.columns.items() if task.cfg.has("columns") else ():
        listed.setdefault(column.group, []).append(name)
    return listed


def leads(task: Task) -> bool:
    """Whether the task's column is the first of its group."""
    column = task.cfg.column
    return column is None or any(names[0] == column for names in groups(task).values())


def chosen(task: Task) -> list[Task]:
    """The task in every column, or in those that ``only`` names.

    Raises:
        ConfigError: when it names one that there is not.
    """
    there = columns(task)
    names = list(there) if task.cfg.only is None else task.cfg.only
    if unknown := [name for name in names if name not in there]:
        raise ConfigError(f"only has {unknown[0]!r}, expected some of {', '.join(there)}")
    return [there[name] for name in names]


def _under(task: Task, name: str, column: Column) -> Task:
    settings = {one.name: getattr(column, one.name) for one in fields(column) if one.name not in _WORDS}
    given = {key: value for key, value in settings.items() if value is not None}
    return task.with_settings(column=name, only=[OURS], **given)
