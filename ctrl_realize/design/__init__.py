"""Controllers for plants with dead time, and what one must know before closing the loop.

Systems in, `control` systems out. Everything works on core and delay apart, so it is exact at any
delay.
"""

from .approximations import pade_ss as pade_ss
from .approximations import thiran as thiran
from .balanced import BalancedReduction as BalancedReduction
from .balanced import hankel_singular_values as hankel_singular_values
from .balanced import reduce as reduce
from .conversions import ContinuousModel as ContinuousModel
from .conversions import to_continuous as to_continuous
from .conversions import to_discrete as to_discrete
from .conversions import to_tf as to_tf
from .delay_line import DelayLineController as DelayLineController
from .delay_robustness import DelayRobustness as DelayRobustness
from .delay_robustness import delay_robustness as delay_robustness
from .estimator import KalmanPredictor as KalmanPredictor
from .estimator import kalman_predictor as kalman_predictor
from .loop_check import LoopCheck as LoopCheck
from .lqg import lqg as lqg
from .margin_result import Margins as Margins
from .margins import margins as margins
from .performance import Performance as Performance
from .performance import performance as performance
from .phase import unwrapped_phase as unwrapped_phase
from .pid import pid as pid
from .pid_controller import PIDController as PIDController
from .pid_table import PIDComparison as PIDComparison
from .pid_table import compare_pid as compare_pid
from .process_model import ProcessModel as ProcessModel
from .reduction import reduce_fopdt as reduce_fopdt
from .reduction import reduce_sopdt as reduce_sopdt
from .regulator import PredictorLQR as PredictorLQR
from .regulator import predictor_lqr as predictor_lqr
from .robustness import RobustnessCheck as RobustnessCheck
from .robustness import UncertaintyBound as UncertaintyBound
from .robustness import robust_stability as robust_stability
from .robustness import uncertainty_bound as uncertainty_bound
from .smith import smith_predictor as smith_predictor

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
