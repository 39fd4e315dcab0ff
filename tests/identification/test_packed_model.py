"""A packed model is the model, without the dense matrices of its delay chain."""

from __future__ import annotations

import gc
import pickle

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.identification.campaign.packed_model import PackedModel
from tests.rigs import step_record

RNG = np.random.default_rng(1)
SISO = ct.ss([[0.9, 0.1], [0, 0.5]], [[0], [1]], [[1, 1 / 3]], 0.1, 7e-4)
MIMO = ct.ss(*(RNG.standard_normal(shape) for shape in ((3, 3), (3, 2), (2, 3), (2, 2))), 0.1)
STATIC = ct.ss([], [], [], [[2.0]], 1.0)


@pytest.mark.parametrize(
    "system",
    [
        cr.DelayedStateSpace(SISO, 37, name="valve", inputs="i", outputs="x", fit="how"),
        cr.DelayedStateSpace(SISO, 0),
        cr.DelayedStateSpace(MIMO, (2, 5), output_delay=(0, 3), name="plant"),
        cr.DelayedStateSpace(STATIC, 4),
    ],
    ids=["siso", "no delay", "mimo", "static"],
)
def test_unpacking_gives_the_model_bit_by_bit(system):
    packed = pickle.loads(pickle.dumps(PackedModel.of(system)))
    for twin in (PackedModel.of(system).unpack(), packed.unpack()):
        for letter in "ABCD":
            assert_array_equal(getattr(twin, letter), getattr(system, letter))
            assert_array_equal(getattr(twin.delay_free, letter), getattr(system.delay_free, letter))
        assert_array_equal(twin.delay, system.delay)
        assert (twin.input_delays, twin.output_delays) == (
            system.input_delays,
            system.output_delays,
        )
        assert (twin.name, twin.dt, twin.fit) == (system.name, system.dt, system.fit)
        assert twin.input_labels == system.input_labels
        assert twin.output_labels == system.output_labels
        assert twin.state_labels == system.state_labels


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    made = step_record(noise=1e-3, before=400, after=1300)
    record = cr.Record(made.time, made.input, made.output, name="r")
    store = cr.io.CampaignStore(tmp_path_factory.mktemp("store"))
    return cr.identify_campaign([record], method="paper", store=store)


def test_a_campaign_with_a_store_holds_no_augmented_matrix(kept):
    gc.collect()
    before = sum(type(thing) is cr.DelayedStateSpace for thing in gc.get_objects())
    twin = pickle.loads(pickle.dumps(kept.rows))
    after = sum(type(thing) is cr.DelayedStateSpace for thing in gc.get_objects())
    assert after == before
    assert twin[0].system.nstates > 30
