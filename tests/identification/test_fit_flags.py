"""What a fit flags, each by itself, on fits that are written by hand."""

from __future__ import annotations

import numpy as np

import ctrl_realize as cr
from ctrl_realize.identification.fit_flags import (
    same_record_flags,
)


def test_records_that_are_others_over_again_are_named():
    time = np.arange(10.0)
    a, b = (cr.Record(time, time > 3, k * time) for k in (1.0, 2.0))
    assert same_record_flags((a, b)) == ()
    (flag,) = same_record_flags((a, b, a, b))
    assert flag.code == "same_records"
    assert flag.message.startswith("2 of 4 records are others over again (the 3. is the 1., the 4.")
    assert "the 2.)" in flag.message
    (many,) = same_record_flags((a,) * 6)
    assert "(the 2. is the 1., the 3. is the 1., the 4. is the 1. and 2 more)" in many.message
    (four,) = same_record_flags((a,) * 5)
    assert "the 4. is the 1. and 1 more)" in four.message
    (three,) = same_record_flags((a,) * 4)
    assert "more" not in three.message
