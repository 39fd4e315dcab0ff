"""Controllers for plants with dead time, and analysis of the closed loop.

Systems in, `control` systems out. Everything works on core and delay apart, so it is exact at any
delay.
"""

from .delay_line import DelayLineController as DelayLineController
from .loops.delay_robustness import DelayRobustness as DelayRobustness
from .loops.delay_robustness import delay_robustness as delay_robustness
from .loops.loop_check import LoopCheck as LoopCheck
from .loops.margin_result import Margins as Margins
from .loops.margins import margins as margins
from .loops.performance import Performance as Performance
from .loops.performance import performance as performance
from .loops.phase import unwrapped_phase as unwrapped_phase
from .loops.robustness import RobustnessCheck as RobustnessCheck
from .loops.robustness import UncertaintyBound as UncertaintyBound
from .loops.robustness import robust_stability as robust_stability
from .loops.robustness import uncertainty_bound as uncertainty_bound
from .models.approximations import pade_ss as pade_ss
from .models.approximations import thiran as thiran
from .models.balanced import BalancedReduction as BalancedReduction
from .models.balanced import hankel_singular_values as hankel_singular_values
from .models.balanced import reduce as reduce
from .models.conversions import ContinuousModel as ContinuousModel
from .models.conversions import to_continuous as to_continuous
from .models.conversions import to_discrete as to_discrete
from .models.conversions import to_tf as to_tf
from .models.process_model import ProcessModel as ProcessModel
from .models.reduction import reduce_fopdt as reduce_fopdt
from .models.reduction import reduce_sopdt as reduce_sopdt
from .predictors.estimator import KalmanPredictor as KalmanPredictor
from .predictors.estimator import kalman_predictor as kalman_predictor
from .predictors.lqg import lqg as lqg
from .predictors.regulator import PredictorLQR as PredictorLQR
from .predictors.regulator import predictor_lqr as predictor_lqr
from .predictors.smith import smith_predictor as smith_predictor
from .tuning.controller import PIDController as PIDController
from .tuning.pid import pid as pid
from .tuning.table import PIDComparison as PIDComparison
from .tuning.table import compare_pid as compare_pid

__all__ = [
    "BalancedReduction",
    "ContinuousModel",
    "DelayLineController",
    "DelayRobustness",
    "KalmanPredictor",
    "LoopCheck",
    "Margins",
    "PIDComparison",
    "PIDController",
    "Performance",
    "PredictorLQR",
    "ProcessModel",
    "RobustnessCheck",
    "UncertaintyBound",
    "compare_pid",
    "delay_robustness",
    "hankel_singular_values",
    "kalman_predictor",
    "lqg",
    "margins",
    "pade_ss",
    "performance",
    "pid",
    "predictor_lqr",
    "reduce",
    "reduce_fopdt",
    "reduce_sopdt",
    "robust_stability",
    "smith_predictor",
    "thiran",
    "to_continuous",
    "to_discrete",
    "to_tf",
    "uncertainty_bound",
    "unwrapped_phase",
]


def __dir__() -> list[str]:
    return __all__
