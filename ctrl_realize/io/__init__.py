"""Files in and out: records, frequency responses, models."""

from .frf import read_frf as read_frf
from .models import load_model as load_model
from .models import save_model as save_model
from .records import read_record as read_record
from .store import CampaignStore as CampaignStore
from .stored_fit import FitSummary as FitSummary

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
