"""Files in and out: records, frequency responses, models."""

from .campaign_store import CampaignStore as CampaignStore
from .fit_summary import FitSummary as FitSummary
from .frf import read_frf as read_frf
from .model_files import load_model as load_model
from .model_files import save_model as save_model
from .records import read_record as read_record

__all__ = [
    "CampaignStore",
    "FitSummary",
    "load_model",
    "read_frf",
    "read_record",
    "save_model",
]


def __dir__() -> list[str]:
    return __all__
