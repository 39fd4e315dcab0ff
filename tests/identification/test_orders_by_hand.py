"""What an order scan reads off its surface, on surfaces that are written by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_realize as cr
from ctrl_realize.errors import OptionError
from ctrl_realize.identification import orders as module

DT = 0.125
MISFITS = np.array(
    [
        [9.0, 8.0, 7.0, 6.2, 6.0, 6.5],
        [5.0, 4.0, 2.0, 1.0, 1.04, 3.0],
        [5.0, 1.02, 1.0, 1.04, 0.96, 3.0],
    ]
)
VALUES = np.arange(24.0).reshape(6, 4) + 1  # of order 1 behind 4 samples 17, and so on
LAST = [17.0, 14.0, 20.0]
CAUSAL = cr.FilterSpec(5, 1.0, zero_phase=False, dt=DT)


@pytest.fixture
def surface(monkeypatch):
    """Misfits of orders 1, 2 and 4 behind 0 to 5 samples, of which order 2 is suggested."""
    made = SimpleNamespace(
        impulse=cr.ImpulseResponse(np.ones(50), DT, filter=CAUSAL),
        orders=(1, 2, 4),
        iae=MISFITS.copy(),
        rounding=0.0,
        samples=30,
        noise_floor=7.0,
        models=SimpleNamespace(singular_values=VALUES.copy()),
        singular_value=lambda order, delay: float(VALUES[delay, order - 1]),
        last=LAST,
        asked=[],
    )

    def scan_surface(*args):
        made.asked.append(args)
        return made

    def suggest_order(given, last):
        assert given is made
        np.testing.assert_array_equal(last, made.last)
        return 2

    monkeypatch.setattr(module, "scan_surface", scan_surface)
    monkeypatch.setattr(module, "suggest_order", suggest_order)
    return made


def scanned(orders=3, **options):
    return cr.scan_orders("pulses", orders, max_delay=5, **options)


def test_every_order_has_its_best_delay_and_those_within_five_percent(surface):
    scan = scanned()
    assert (scan.orders, scan.delays) == ((1, 2, 4), (4, 3, 4))
    assert scan.intervals == ((3, 4), (3, 4), (2, 4))  # 6.3, 1.05 and 1.008
    np.testing.assert_array_equal(scan.iae, MISFITS)
    np.testing.assert_array_equal(scan.singular_values, VALUES)
    assert not scan.iae.flags.writeable
    assert not scan.singular_values.flags.writeable
    assert (scan.order, scan.delay, scan.max_delay) == (2, 3, 5)
    assert (scan.samples, scan.noise_floor, scan.dt) == (30, 7.0, DT)
    assert scan.impulse is surface.impulse
    assert [scan.last_singular_value(order) for order in scan.orders] == LAST


def test_misfits_that_differ_by_rounding_are_equally_good(surface):
    surface.rounding = 0.05
    surface.last = [17.0, 14.0, 12.0]
    scan = scanned()
    assert scan.delays == (4, 3, 2)  # of order 4 1.0 is as good as 0.96
    assert scan.intervals == ((3, 4), (3, 4), (1, 4))


def test_flags_are_those_of_the_order_that_is_suggested(surface):
    # the last singular value of order 2 is twice that of the noise
    assert [flag.code for flag in scanned().flags] == ["order_near_noise", "filter_delay"]
    assert "singular value 2 is 2.00 times" in scanned().flags[0].message
    surface.iae[1] = [1.2, 4.0, 2.0, 1.0, 3.0, 1.04]
    assert [flag.code for flag in scanned().flags] == [
        "delay_at_bound",
        "no_delay_resolved",
        "several_minima",
        "order_near_noise",
        "filter_delay",
    ]


def test_orders_are_tried_once_in_their_order(surface):
    scanned(3)
    scanned([4, 2, 2], samples=20, feedthrough=True, hankel="padded", dt=DT)
    scanned(order for order in (2, 1))
    assert surface.asked == [
        ("pulses", (1, 2, 3), 5, None, None, "square", None),
        ("pulses", (2, 4), 5, 20, True, "padded", DT),
        ("pulses", (1, 2), 5, None, None, "square", None),
    ]
    scanned(1)
    assert surface.asked[-1][1] == (1,)
    cr.scan_orders("pulses", max_delay=5)
    assert surface.asked[-1][1] == (1, 2, 3, 4, 5, 6, 7, 8)
    for orders, match in (([], "empty"), (0, "orders=0"), ([0], "orders=0"), ("3", "orders='3'")):
        with pytest.raises(OptionError, match=match):
            scanned(orders)


def test_the_system_of_an_order_is_the_best_of_the_surface(surface, monkeypatch):
    monkeypatch.setattr(module, "best_of", lambda given, order: (given, order))
    scan = scanned()
    assert scan.system() == (surface, 2)
    assert [scan.system(order)[1] for order in (1, 4)] == [1, 4]
    for order, match in ((3, "order=3 was not scanned"), (0, "order=0"), (1.0, "order=1.0")):
        with pytest.raises(OptionError, match=match):
            scan.system(order)


def test_the_table_has_a_row_for_each_order(surface):
    table = scanned().table()
    assert table.index.name == "order"
    assert list(table.index) == [1, 2, 4]
    assert table.loc[2].to_dict() == {
        "delay": 3,
        "low": 3,
        "high": 4,
        "dead_time": 3 * DT,
        "iae": 1.0,
        "contrast": 5.0,
        "singular_value": 14.0,
        "noise_ratio": 2.0,
        "suggested": True,
    }
    assert table["suggested"].tolist() == [False, True, False]
    assert table["high"].tolist() == [4, 4, 4]


def test_exact_data_have_an_endless_contrast_and_unknown_noise_no_ratio(surface):
    surface.iae[1, 3] = 0.0
    for floor in (None, 0.0):
        scan = replace(scanned(), noise_floor=floor)
        assert scan.table()["contrast"].tolist() == [1.5, np.inf, 5.0 / 0.96]
        assert scan.table()["noise_ratio"].isna().all()
        assert "noise" not in dict(scan._rows())["order 1"]


def test_the_card_tells_every_order(surface):
    scan = scanned()
    assert scan.report().splitlines()[:4] == [
        "Order scan: order 2 behind 3 samples suggested",
        "  order 1  delay 4 (3...4) samples, IAE 6, singular value 17, 2.43 x noise",
        "  order 2  delay 3 (3...4) samples, IAE 1, singular value 14, 2.00 x noise",
        "  order 4  delay 4 (2...4) samples, IAE 0.96, singular value 20, 2.86 x noise",
    ]
    assert repr(scan) == "<OrderScan: orders 1...4, d = 0...5, suggested 2>"
