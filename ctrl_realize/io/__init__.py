"""Files in and out: records, frequency responses, models."""

from .frf import read_frf as read_frf
from .records import read_record as read_record
