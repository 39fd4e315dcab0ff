"""What a user's typed script looks like; mypy --strict must have nothing to say."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ctrl_realize as cr


def model_of(path: Path) -> cr.DelayedStateSpace:
    record = cr.read_record(path)
    edge: cr.data.StepEdge = cr.detect_step(record)
    step: cr.data.StepResponse = cr.unit_step(record, edge)
    impulse: cr.ImpulseResponse = cr.impulse_from_step(step, cutoff_hz=50.0)
    scanned: cr.DelayedStateSpace = cr.estimate_delay(impulse, 3, max_delay=100)
    orders: cr.identification.OrderScan = cr.scan_orders(impulse, range(1, 6), max_delay=100)
    realized = cr.realize(impulse, orders.order, delay=37, hankel="padded")
    fitted = cr.fit_output_error(record, structures=[(3, 3)], loss="least_squares")
    simple = cr.identify(record, method="scan", order=2)
    for system in (scanned, realized, fitted, simple):
        cr.save_model(path.with_suffix(".json"), system)
    return cr.load_model(path.with_suffix(".json"))


def campaign_of(records: list[cr.Record]) -> float:
    campaign: cr.Campaign = cr.identify_campaign(records, n_jobs=2, method="paper")
    mean: float = campaign.statistics(trim=3).mean
    best: cr.identification.CampaignRow = campaign.best
    return mean + best.delay + float(np.sum(campaign.delays))


def compared(system: cr.DelayedStateSpace, frf: cr.MeasuredFRF) -> str:
    comparison: cr.frequency.FRFComparison = cr.compare_frf(system, frf.between_hz(0.1, 13.0))
    return comparison.report()
