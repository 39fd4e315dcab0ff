"""Controllers for plants with dead time, and what one must know before closing the loop.

Systems in, `control` systems out. Everything works on core and delay apart, so it is exact at any
delay.
"""

from .delay_line import DelayLineController as DelayLineController
from .delay_robustness import DelayRobustness as DelayRobustness
from .delay_robustness import delay_robustness as delay_robustness
from .margins import Margins as Margins
from .margins import margins as margins
from .phase import unwrapped_phase as unwrapped_phase
from .smith import smith_predictor as smith_predictor
