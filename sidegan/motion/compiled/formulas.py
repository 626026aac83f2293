"""Bounds of motion within a cell, for numbers and tensors alike: compiled code and plain torch share them.

A cell is a time interval of half width h around a sample. The bound of a torque's rate is the Newton–Euler
recursion on norms: each quantity x of a link carries bounds (|x|, |ẋ|), the derivative being that of its
components in the link's frame, which turns at the joint's speed. No function here calls another.
"""

from typing import Any

Link = tuple[Any, Any, Any, Any, Any, Any]  # |w|, its rate, |α|, its rate, |a|, its rate
Carried = tuple[Any, Any, Any, Any]  # |force|, its rate, |moment|, its rate


def cell_bounds(dq: Any, ddq: Any, jerk: Any, half: float) -> tuple[Any, Any, Any, Any]:
    """Largest change of position and velocity in a cell, speed and acceleration, by Taylor's theorem."""
    speed, acceleration = abs(dq), abs(ddq)
    change = half * (speed + half / 2 * (acceleration + half / 3 * jerk))
    velocity_change = half * (acceleration + half / 2 * jerk)
    return change, velocity_change, speed + velocity_change, acceleration + half * jerk


def link_bounds(slides: bool, v: Any, acc: Any, jerk: Any, travel: Any, parent: Link) -> Link:
    """Bounds of a link's motion from its parent's and its joint's largest speed, acceleration and jerk."""
    w, dw, al, dal, a, da = parent
    swing = al + w * w
    a, da = a + swing * travel, da + (dal + 2 * w * dw) * travel
    if slides:
        return w, dw, al, dal, a + acc + 2 * w * v, da + swing * v + jerk + 2 * (dw * v + w * acc)
    da = da + v * a
    dal = dal + v * al + jerk + (dw + v * w) * v + w * acc
    return w + v, dw + v * w + acc, al + acc + w * v, dal, a, da


def wrench_bounds(mass: Any, first: Any, spin: Any, link: Link) -> Carried:
    """Bounds of the force and the moment that a link's motion takes."""
    w, dw, al, dal, a, da = link
    swing, dswing = al + w * w, dal + 2 * w * dw
    force, dforce = mass * a + first * swing, mass * da + first * dswing
    return force, dforce, first * a + spin * swing, first * da + spin * dswing


def carried_bounds(slides: bool, v: Any, travel: Any, wrench: Carried) -> Carried:
    """Bounds of a wrench in the frame of the link's parent."""
    f, df, n, dn = wrench
    if slides:
        return f, df, n + travel * f, dn + travel * df + v * f
    df, dn = df + v * f, dn + v * n
    return f, df, n + travel * f, dn + travel * df
