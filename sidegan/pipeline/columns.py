"""Columns of a comparison: the same artifacts under the run's own settings and under others."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.schema import Column
from sidegan.pipeline.task import Task

OURS = "ours"  # the run's own settings
_WORDS = {"title", "group"}  # of a column, which are no settings of the run


def columns(task: Task) -> dict[str, Task]:
    """The task under its own settings, and under those of every column, by name."""
    others = task.cfg.columns if task.cfg.has("columns") and task.cfg.column is None else {}
    return {OURS: task} | {name: _under(task, name, column) for name, column in others.items()}


def groups(task: Task) -> dict[str, list[str]]:
    """Names of the columns that differ in their seed set alone, by their group."""
    listed: dict[str, list[str]] = {OURS: [OURS]}
    for name, column in task.cfg.columns.items() if task.cfg.has("columns") else ():
        listed.setdefault(column.group, []).append(name)
    return listed


def in_columns(listed: Callable[[Task], Iterable[Artifact]]) -> Callable[[Task], Iterator[Artifact]]:
    """The artifacts of a stage in every column; what columns share is listed by each."""

    def everywhere(task: Task) -> Iterator[Artifact]:
        for one in columns(task).values():
            yield from listed(one)

    return everywhere


def _under(task: Task, name: str, column: Column) -> Task:
    settings = {one.name: getattr(column, one.name) for one in fields(column) if one.name not in _WORDS}
    given = {key: value for key, value in settings.items() if value is not None}
    return task.with_settings(column=name, **given)
