# What the package exports: read by type checkers and editors, and by __init__.py, which loads
# each name when it is first asked for. At the top stand thirty names that most users need;
# results, errors and the further steps of the methods are in the modules.

from . import actuators as actuators
from . import bench as bench
from . import data as data
from . import datasets as datasets
from . import design as design
from . import errors as errors
from . import experiment as experiment
from . import export as export
from . import frequency as frequency
from . import identification as identification
from . import io as io
from . import paper as paper
from . import plots as plots
from . import report as report
from . import results as results
from . import validation as validation
from . import valves as valves
from .data import ImpulseResponse as ImpulseResponse
from .data import MeasuredFRF as MeasuredFRF
from .data import Record as Record
from .delayed import DelayedStateSpace as DelayedStateSpace
from .delayed import DelaySystem as DelaySystem
from .delayed import delay as delay
from .delayed import delayed_ss as delayed_ss
from .delayed import exp as exp
from .delayed import interconnect as interconnect
from .design import extend_control as extend_control
from .errors import CtrlRealizeError as CtrlRealizeError
from .errors import CtrlRealizeWarning as CtrlRealizeWarning
from .frequency import compare_frf as compare_frf
from .frequency import fit_frf as fit_frf
from .frequency import impulse_from_frf as impulse_from_frf
from .frequency import spectral_frf as spectral_frf
from .frequency import stepped_sine_frf as stepped_sine_frf
from .identification import Campaign as Campaign
from .identification import DelayTracker as DelayTracker
from .identification import detect_step as detect_step
from .identification import estimate_delay as estimate_delay
from .identification import fit_output_error as fit_output_error
from .identification import fit_state_space as fit_state_space
from .identification import identify as identify
from .identification import identify_campaign as identify_campaign
from .identification import impulse_from_io as impulse_from_io
from .identification import impulse_from_step as impulse_from_step
from .identification import realize as realize
from .identification import scan_orders as scan_orders
from .identification import unit_step as unit_step
from .interactive.widget import app as app
from .io import load_model as load_model
from .io import read_frf as read_frf
from .io import read_record as read_record
from .io import save_model as save_model
from .validation import compare as compare

__version__: str
