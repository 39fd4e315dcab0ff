"""Records of every kind, through the output-error fit of the delay."""

from __future__ import annotations

import numpy as np
from hypothesis import event, given
from hypothesis import strategies as st

import ctrl_realize as cr
from tests.fuzz.lane import fuzz, good_end
from tests.fuzz.test_estimators import check, experiments


@fuzz(6)
@given(
    experiments(),
    st.one_of(st.none(), st.integers(0, 6)),
    st.one_of(st.none(), st.integers(-1, 400)),
    st.sampled_from(["huber", "least_squares", "absolute"]),
)
def test_any_record_is_fitted_or_refused(arrays, order, max_delay, loss):
    with good_end(seconds=60) as models:
        record = cr.Record(*arrays)
        models.append(cr.identify(record, order=order, max_delay=max_delay, loss=loss))
    for model in models:
        check(model)
        low, high = model.fit.interval
        assert low <= model.fit.dead_time <= high
        assert low >= 0
        event("interval of finite width" if np.isfinite(high - low) else "no limit")
