"""A packed model is the model, without the dense matrices of its delay chain."""

from __future__ import annotations

import gc
import pickle
import tracemalloc

import control as ct
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from ctrl_realize.identification.packed_model import PackedModel
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


def test_a_long_delay_takes_no_more_than_a_short_one():
    short, long = (
        len(pickle.dumps(PackedModel.of(cr.DelayedStateSpace(SISO, d)))) for d in (3, 2000)
    )
    assert long - short < 10


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    made = step_record(noise=1e-3, before=400, after=1300)
    record = cr.Record(made.time, made.input, made.output, name="r")
    store = cr.CampaignStore(tmp_path_factory.mktemp("store"))
    return cr.identify_campaign([record], method="paper", store=store)


def test_a_campaign_with_a_store_holds_no_augmented_matrix(kept):
    gc.collect()
    before = sum(type(thing) is cr.DelayedStateSpace for thing in gc.get_objects())
    twin = pickle.loads(pickle.dumps(kept.rows))
    after = sum(type(thing) is cr.DelayedStateSpace for thing in gc.get_objects())
    assert after == before
    assert twin[0].system.nstates > 30


def test_a_row_that_comes_from_a_worker_takes_a_few_kilobytes(kept):
    sent = pickle.dumps(kept.rows[0])
    # 1.6 kB; the matrices of the chain alone would be 20 kB at this delay
    assert len(sent) < 4000
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        rows = [pickle.loads(sent) for _ in range(100)]
        grown = (tracemalloc.get_traced_memory()[0] - before) / len(rows)
    finally:
        tracemalloc.stop()
    # 4.5 kB, most of it the report's text; it was 39 kB with the matrices
    assert grown < 8000
