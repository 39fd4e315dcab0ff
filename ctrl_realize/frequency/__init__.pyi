# What the module offers, loaded when it is first asked for.

from .compare import compare_frf as compare_frf
from .comparison import FRFComparison as FRFComparison
from .fit import fit_frf as fit_frf
from .frf_fit import FRFFit as FRFFit
from .from_frf import impulse_from_frf as impulse_from_frf
from .spectral import spectral_frf as spectral_frf
from .stepped_sine import stepped_sine_frf as stepped_sine_frf
