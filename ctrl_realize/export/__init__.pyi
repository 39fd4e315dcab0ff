# What the module offers, loaded when it is first asked for.

from .code import to_c as to_c
from .code import to_python as to_python
from .code import to_structured_text as to_structured_text
from .fmu import to_fmu as to_fmu
from .matlab import to_matlab as to_matlab
