# What the module offers, loaded when it is first asked for.

from .campaign.campaign import Campaign as Campaign
from .campaign.rows import CampaignRow as CampaignRow
from .campaign.run import identify_campaign as identify_campaign
from .impulse.from_io import impulse_from_io as impulse_from_io
from .methods import identify as identify
from .output_error.fit import fit_output_error as fit_output_error
from .output_error.result import OutputErrorFit as OutputErrorFit
from .realization.delay_scan import estimate_delay as estimate_delay
from .realization.delay_scan_result import DelayScan as DelayScan
from .realization.mimo import MimoRealization as MimoRealization
from .realization.mimo import delay_matrix as delay_matrix
from .realization.mimo import realize_mimo as realize_mimo
from .realization.order_scan import OrderScan as OrderScan
from .realization.order_scan import scan_orders as scan_orders
from .realization.realize import realize as realize
from .realization.result import Realization as Realization
from .state_space_fit.fit import fit_state_space as fit_state_space
from .state_space_fit.fit import refine_state_space as refine_state_space
from .state_space_fit.result import StateSpaceFit as StateSpaceFit
from .step.impulse import impulse_from_step as impulse_from_step
from .step.steps import detect_step as detect_step
from .step.steps import unit_step as unit_step
from .tracking.results import TrackHistory as TrackHistory
from .tracking.results import TrackPoint as TrackPoint
from .tracking.tracker import DelayTracker as DelayTracker
