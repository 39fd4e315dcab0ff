# What the package exports: read by type checkers and editors, and by __init__.py, which loads
# each name when it is first asked for.

from . import bench as bench
from . import design as design
from . import errors as errors
from . import io as io
from . import paper as paper
from . import plots as plots
from . import report as report
from .data import FilterSpec as FilterSpec
from .data import ImpulseResponse as ImpulseResponse
from .data import MeasuredFRF as MeasuredFRF
from .data import Record as Record
from .data import StepEdge as StepEdge
from .data import StepResponse as StepResponse
from .data.impulse_estimate import ImpulseEstimate as ImpulseEstimate
from .delayed import DelayedStateSpace as DelayedStateSpace
from .delayed import delayed_ss as delayed_ss
from .errors import CtrlRealizeError as CtrlRealizeError
from .errors import CtrlRealizeWarning as CtrlRealizeWarning
from .frequency import FRFComparison as FRFComparison
from .frequency import FRFFit as FRFFit
from .frequency import compare_frf as compare_frf
from .frequency import fit_frf as fit_frf
from .frequency import impulse_from_frf as impulse_from_frf
from .frequency import spectral_frf as spectral_frf
from .frequency import stepped_sine_frf as stepped_sine_frf
from .identification.campaign.campaign import Campaign as Campaign
from .identification.campaign.rows import CampaignRow as CampaignRow
from .identification.campaign.run import identify_campaign as identify_campaign
from .identification.identify import identify as identify
from .identification.impulse.from_io import impulse_from_io as impulse_from_io
from .identification.output_error.fit import fit_output_error as fit_output_error
from .identification.output_error.result import OutputErrorFit as OutputErrorFit
from .identification.realization.delay_scan import estimate_delay as estimate_delay
from .identification.realization.delay_scan_result import DelayScan as DelayScan
from .identification.realization.mimo import MimoRealization as MimoRealization
from .identification.realization.mimo import delay_matrix as delay_matrix
from .identification.realization.mimo import realize_mimo as realize_mimo
from .identification.realization.order_scan import OrderScan as OrderScan
from .identification.realization.order_scan import scan_orders as scan_orders
from .identification.realization.realize import realize as realize
from .identification.realization.result import Realization as Realization
from .identification.state_space_fit.fit import fit_state_space as fit_state_space
from .identification.state_space_fit.fit import refine as refine
from .identification.state_space_fit.result import StateSpaceFit as StateSpaceFit
from .identification.step.impulse import impulse_from_step as impulse_from_step
from .identification.step.steps import detect_step as detect_step
from .identification.step.steps import unit_step as unit_step
from .identification.tracking.results import TrackHistory as TrackHistory
from .identification.tracking.results import TrackPoint as TrackPoint
from .identification.tracking.tracker import DelayTracker as DelayTracker
from .identification.validation.bootstrap import Bootstrap as Bootstrap
from .identification.validation.bootstrap import bootstrap as bootstrap
from .identification.validation.cross_validation import cross_validate as cross_validate
from .identification.validation.delay_estimates import (
    compare_delay_estimates as compare_delay_estimates,
)
from .identification.validation.delay_estimates_result import DelayComparison as DelayComparison
from .identification.validation.delay_estimates_result import DelayEstimate as DelayEstimate
from .identification.validation.prediction import Prediction as Prediction
from .identification.validation.prediction import predict as predict
from .identification.validation.residuals import analyse_residuals as analyse_residuals
from .identification.validation.residuals_result import ResidualAnalysis as ResidualAnalysis
from .io import CampaignStore as CampaignStore
from .io import load_model as load_model
from .io import read_frf as read_frf
from .io import read_record as read_record
from .io import save_model as save_model
from .results import Flag as Flag

__version__: str
