"""Random trains of which the parts are added in another order, under other names: impacts through gears among them."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import Array, share_of_examples
from tests.properties.test_hybrid_reference import RESTS, SWITCHING, network
from tests.properties.test_time_stepping import GearedDraw
from tests.reference.hybrid_train import Train

SAME = 1e-9
"""Of the largest speed: sums are rounded in another order, and impacts and stiff contacts multiply that."""
FIRST = 3
"""Rebounds of each contact that are compared: where they come ever faster, rounding moves their times."""


def reordered(train: Train, seed: int) -> tuple[Train, Array, Array]:
    """The train with its inertias and joints in another order, and old numbers of the inertias and joints in that."""
    rng = np.random.default_rng(seed)
    inertias, joints = rng.permutation(len(train.inertias)), rng.permutation(len(train.joints))
    place = {-1: -1} | {int(old): new for new, old in enumerate(inertias)}
    moved = [replace(joint, a=place[joint.a], b=place[joint.b]) for joint in train.joints]
    sources = tuple(replace(source, a=place[source.a]) for source in reversed(train.sources))
    made = Train(
        tuple(train.inertias[k] for k in inertias),
        tuple(train.speeds[k] for k in inertias),
        tuple(moved[k] for k in joints),
        sources,
        train.t_end,
    )
    return made, inertias, joints


def motion(train: Train) -> tuple[Array, list[list[float]]]:
    """The speeds at the end, and the times of the first rebounds of each joint."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)  # parts may be loose of each other
        sol = network(train).simulate(train.t_end, rtol=1e-12, t_eval=2)
    rebounds = [
        [time for time, name, _, after in sol.events if name == f"x{k}" and after == "rebound"][:FIRST]
        for k in range(len(train.joints))
    ]
    return np.array([sol[f"J{k}.omega"][-1] for k in range(len(train.inertias))]), rebounds


@pytest.mark.slow
@given(st.integers(0, 10**6))
@share_of_examples(0.02)
def test_the_order_of_parts_beside_lossy_gears_changes_nothing(seed: int) -> None:
    """Torques that several parts hold together they carry in their order, so of events those of contacts are told."""
    train = GearedDraw(seed, ("rigid", *SWITCHING), most=5).train()
    other, inertias, joints = reordered(train, seed)
    (speeds, rebounds), (found, found_rebounds) = motion(train), motion(other)
    uncertain = RESTS * any(joint.restitution for joint in train.joints)
    size = max(1.0, np.abs(speeds).max())
    np.testing.assert_allclose(found, speeds[inertias], rtol=0, atol=SAME * size + uncertain)
    for k, old in enumerate(joints):
        np.testing.assert_allclose(found_rebounds[k], rebounds[old], rtol=0, atol=1e-7)
