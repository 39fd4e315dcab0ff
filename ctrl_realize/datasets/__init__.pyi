# What the module offers, loaded when it is first asked for.

from .info import DataFile as DataFile
from .info import DatasetInfo as DatasetInfo
from .loading import Dataset as Dataset
from .loading import load as load
from .loading import names as names
from .loading import path as path
from .loading import table as table
