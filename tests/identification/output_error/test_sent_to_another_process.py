"""A fit that is stored or sent to another process has what it finds only when it is asked."""

import pickle

import numpy as np
from numpy.testing import assert_array_equal

import ctrl_realize as cr
from tests import rigs


def test_a_fit_that_was_sent_says_what_it_would_have_said():
    record = rigs.step_record(rigs.R2, before=300, after=900, dt=0.02, delay=20.3, noise=0.02)
    fit = cr.fit_output_error(record, structures=[(1, 1)]).fit
    asked = cr.fit_output_error(record, structures=[(1, 1)]).fit
    assert asked.estimate.others.not_ruled_out
    sent = pickle.loads(pickle.dumps(fit))
    for one, other in zip(sent.plausible_models.models, asked.plausible_models.models, strict=True):
        assert_array_equal(one.poles, other.poles)
    lines = (one.estimate.others.not_ruled_out for one in (sent, asked))
    for one, other in zip(*lines, strict=True):
        assert one.interval == other.interval
    assert sent.report() == asked.report()
    assert np.isfinite(sent.verdicts[2].number)
    # the fits from which the models are drawn stay where they are
    assert len(pickle.dumps(fit.estimate.drawn)) < 20_000
