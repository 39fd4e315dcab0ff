# What the module offers, loaded when it is first asked for.

from .build import write_campaign as write_campaign
from .build import write_comparison as write_comparison
from .build import write_identification as write_identification
from .loops import write_loop_report as write_loop_report
from .programs import identification_schema as identification_schema
from .programs import summary as summary
from .valves import write_valve_report as write_valve_report
from .verdict import verdict_of as verdict_of
