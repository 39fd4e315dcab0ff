# What the module offers, loaded when it is first asked for.

from .control_loop import LoopRecord as LoopRecord
from .control_loop import ValveLoop as ValveLoop
from .control_valve import Valve as Valve
from .loop_set_up import valve_loop as valve_loop
from .plant import Plant as Plant
from .plants import flow_loop as flow_loop
from .plants import heater as heater
from .plants import tank as tank
from .relay import relay_test as relay_test
from .set_up import paper_valve as paper_valve
from .set_up import valve as valve
from .truth import PlantTruth as PlantTruth
from .truth import ValveTruth as ValveTruth
