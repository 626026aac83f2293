"""Which pairs of links are kept apart: not neighbours, not named ones, not such that provably never touch."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from sidegan.errors import InfeasibleError
from sidegan.robot import Arm, Setup, changes, command_messages
from sidegan.validity import Constraints
from sidegan.validity.capsules import capsule_distances
from sidegan.validity.pairs import pairs_of, random_configurations
from tests.refusals import refused
from tests.robot.urdf import ball, collision, joint, link, more, robot


def chain(radius: float) -> str:
    """Four links 0.3 m apart in a row that fold upon each other, with a ball at each origin."""
    parts = [link("base", ball(radius))]
    for parent, child in (("base", "one"), ("one", "two"), ("two", "three")):
        parts += [joint(f"to_{child}", parent, child, origin='xyz="0.3 0 0"'), link(child, ball(radius))]
    return robot(*parts)


def names(arm: Arm) -> set[frozenset[str]]:
    return {frozenset(arm.capsules.owners[k] for k in pair) for pair in pairs_of(arm).checked.tolist()}


def test_neighbouring_links_are_exempt(load) -> None:
    arm = load(chain(0.05))
    assert names(arm) == {frozenset(pair) for pair in (("base", "two"), ("base", "three"), ("one", "three"))}
    assert set(pairs_of(arm).exempt) == {("base", "one"), ("one", "two"), ("three", "two")}


def test_a_pillar_on_the_base_is_not_a_neighbour(load) -> None:
    """A pillar on the base is not the link that the first joint hangs on."""
    mount = joint("mount", "base", "pillar", "fixed", 'xyz="0 0.5 0"')
    arm = load(more(chain(0.05), mount, link("pillar", ball(0.05))))
    assert frozenset({"pillar", "one"}) in names(arm)
    assert frozenset({"base", "one"}) not in names(arm)


def test_a_link_without_shape_still_counts_between_neighbours(load) -> None:
    text = chain(0.05).replace(link("one", ball(0.05)), link("one"))
    arm = load(text)
    assert names(arm) == {frozenset({"base", "two"}), frozenset({"base", "three"})}  # two joints between


def test_links_that_always_touch_are_refused_with_a_setting_that_works(load) -> None:
    text = chain(0.31)
    with refused(InfeasibleError, "base and two") as caught, command_messages():
        Constraints(load(text))
    (remedy,) = re.findall(r"'robot\.may_touch=(.*?)'", str(caught.value))
    pairs = [tuple(pair) for pair in yaml.safe_load(remedy)]
    assert ("base", "two") in pairs and ("base", "three") not in pairs
    arm = load(text, Setup(may_touch=pairs))
    constraints = Constraints(arm)
    assert names(arm) == {frozenset({"base", "three"})}
    assert pairs_of(arm).named == {pair: ("robot.may_touch", 1.0) for pair in pairs}
    assert "may touch: base – two (robot.may_touch, touch in 100 %)" in constraints.described()
    assert changes("robot", arm.setup) == [f"'robot.may_touch={remedy}'"]
    assert arm.digest != load(text).digest


def test_pairs_disabled_by_the_description_are_exempt(load) -> None:
    text = chain(0.22)
    assert frozenset({"base", "two"}) in names(load(text))
    arm = load(more(text, '<disable_collisions link1="two" link2="base" reason="Never"/>'))
    assert frozenset({"base", "two"}) not in names(arm)
    ((why, share),) = pairs_of(arm).named.values()
    assert why == "Never" and 0.05 < share < 0.9
    distances = capsule_distances(arm, random_configurations(arm, 1000), np.array([[0, 2]]))
    assert share == pytest.approx((distances <= 0).mean())


def test_pairs_are_dropped_only_if_proven_never_to_touch(load) -> None:
    box = collision('<box size="0.2 0.04 0.04"/>', 'xyz="0.15 0 0"')  # along the links
    text, ones = chain(0.05).replace(ball(0.05), box), np.ones(3)
    arm = load(text)
    calm = replace(arm, position_lower=-0.3 * ones, position_upper=0.3 * ones)
    free = replace(arm, position_lower=-3.1 * ones, position_upper=3.1 * ones)
    every = {("base", "two"), ("base", "three"), ("one", "three")}
    assert not names(calm) and set(pairs_of(calm).never) == every
    assert not pairs_of(free).never and len(names(free)) == 3
    assert "3 never touch" in Constraints(calm).described()


def test_hulls_decide_whether_links_always_touch(load) -> None:
    """Capsules around flat plates overlap wherever the arm is; the plates do not."""
    plate = collision('<box size="0.7 0.7 0.01"/>')
    text = chain(0.05).replace(ball(0.05), plate).replace('xyz="0.3 0 0"', 'xyz="0 0 0.1"')
    arm = load(text)
    assert (capsule_distances(arm, random_configurations(arm), np.array([[0, 2]])) < 0).all()
    Constraints(arm)
