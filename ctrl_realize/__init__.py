"""Models with dead time from measured responses, as python-control systems.

record = cr.read_record("valve.csv")      # or cr.Record(t, u, y)
sys    = cr.identify(record)              # a control.StateSpace with z^-d
ct.bode_plot([sys, cr.read_frf("frf.csv")])
"""

from . import bench as bench
from . import design as design
from . import paper as paper
from . import plots as plots
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
from .identification.bootstrap import Bootstrap as Bootstrap
from .identification.bootstrap import bootstrap as bootstrap
from .identification.campaign import Campaign as Campaign
from .identification.campaign_row import CampaignRow as CampaignRow
from .identification.campaign_run import identify_campaign as identify_campaign
from .identification.channels import ChannelRealization as ChannelRealization
from .identification.channels import channel_delays as channel_delays
from .identification.channels import realize_channels as realize_channels
from .identification.cross_check import DelayCheck as DelayCheck
from .identification.cross_check import DelayView as DelayView
from .identification.cross_check import check_delay as check_delay
from .identification.delay_fit import fit_delay as fit_delay
from .identification.delay_fit_result import DelayFit as DelayFit
from .identification.delay_scan import DelayScan as DelayScan
from .identification.delay_scan import estimate_delay as estimate_delay
from .identification.from_io import ImpulseEstimate as ImpulseEstimate
from .identification.from_io import impulse_from_io as impulse_from_io
from .identification.identify import identify as identify
from .identification.orders import OrderScan as OrderScan
from .identification.orders import scan_orders as scan_orders
from .identification.realization import Realization as Realization
from .identification.realization import realize as realize
from .identification.residuals import Prediction as Prediction
from .identification.residuals import ResidualCheck as ResidualCheck
from .identification.residuals import check_residuals as check_residuals
from .identification.residuals import cross_validate as cross_validate
from .identification.residuals import predict as predict
from .identification.steps import detect_step as detect_step
from .identification.steps import impulse_from_step as impulse_from_step
from .identification.steps import unit_step as unit_step
from .identification.tracked import DelayTrack as DelayTrack
from .identification.tracked import TrackedDelay as TrackedDelay
from .identification.tracker import DelayTracker as DelayTracker
from .io import CampaignStore as CampaignStore
from .io import load_model as load_model
from .io import read_frf as read_frf
from .io import read_record as read_record
from .io import save_model as save_model
from .results import Flag as Flag
from .signals import FilterSpec as FilterSpec
from .signals import ImpulseResponse as ImpulseResponse
from .signals import MeasuredFRF as MeasuredFRF
from .signals import Record as Record
from .signals import StepEdge as StepEdge
from .signals import StepResponse as StepResponse

__version__ = "0.1.0"
