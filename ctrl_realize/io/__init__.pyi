# What the module offers, loaded when it is first asked for.

from .frf import read_frf as read_frf
from .models import load_model as load_model
from .models import save_model as save_model
from .records import read_record as read_record
from .records import read_records as read_records
from .store import CampaignStore as CampaignStore
from .stored_fit import FitSummary as FitSummary
