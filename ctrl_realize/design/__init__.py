"""Controllers for plants with dead time, and analysis of the closed loop.

All functions use core and delay separately, so that they are exact at any delay. Results are
`control` systems.
"""

from .delay_line import DelayLineController
from .loops.delay_robustness import delay_robustness
from .loops.delay_robustness_result import DelayRobustness
from .loops.gang_of_four import gang_of_four
from .loops.loop_check import LoopCheck
from .loops.margin_result import Margins
from .loops.margins import margins
from .loops.performance import Performance, performance
from .loops.phase import unwrapped_phase
from .loops.robust_stability import RobustnessCheck, UncertaintyBound, robust_stability
from .loops.root_locus import root_locus
from .loops.uncertainty import uncertainty_bound
from .models.approximations import pade_ss, thiran
from .models.balanced import BalancedReduction, hankel_singular_values, reduce
from .models.conversions import ContinuousModel, to_continuous, to_discrete, to_tf
from .models.process_model import ProcessModel
from .models.reduction import reduce_fopdt, reduce_sopdt
from .predictors.estimator import KalmanPredictor, kalman_predictor
from .predictors.lqg import LQGController, lqg
from .predictors.regulator import PredictorLQR, predictor_lqr
from .predictors.smith import SmithPredictor, smith_predictor
from .tuning.algorithm import PIDAlgorithm
from .tuning.controller import PIDController
from .tuning.forms import PIDForm, pid_forms
from .tuning.pid import pid
from .tuning.simulated import LoopSimulation, simulate_loop
from .tuning.table import PIDComparison, compare_pid

__all__ = [
    "BalancedReduction",
    "ContinuousModel",
    "DelayLineController",
    "DelayRobustness",
    "KalmanPredictor",
    "LQGController",
    "LoopCheck",
    "LoopSimulation",
    "Margins",
    "PIDAlgorithm",
    "PIDComparison",
    "PIDController",
    "PIDForm",
    "Performance",
    "PredictorLQR",
    "ProcessModel",
    "RobustnessCheck",
    "SmithPredictor",
    "UncertaintyBound",
    "compare_pid",
    "delay_robustness",
    "gang_of_four",
    "hankel_singular_values",
    "kalman_predictor",
    "lqg",
    "margins",
    "pade_ss",
    "performance",
    "pid",
    "pid_forms",
    "predictor_lqr",
    "reduce",
    "reduce_fopdt",
    "reduce_sopdt",
    "robust_stability",
    "root_locus",
    "simulate_loop",
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
