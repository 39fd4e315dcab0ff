"""Files: records, frequency responses, models."""

from .frf import read_frf
from .models import load_model, save_model
from .records import read_record, read_records
from .store import CampaignStore
from .stored_fit import FitSummary

__all__ = [
    "CampaignStore",
    "FitSummary",
    "load_model",
    "read_frf",
    "read_record",
    "read_records",
    "save_model",
]


def __dir__() -> list[str]:
    return __all__
