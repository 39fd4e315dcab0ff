"""How controllers and PLC blocks write PID parameters: structure, units, filter, scaling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Layout:
    """The parameters that one kind of controller asks for.

    Attributes
    ----------
    title : str
    structure : {"ideal", "series", "parallel"}
    gain, integral, derivative : str
        Labels of the parameters.
    band : bool
        The gain is a proportional band in percent, 100 / gain.
    rate : bool
        The integral is in repeats per unit of time, the inverse of the integral time.
    unit : str or None
        Unit of time, ``"s"`` or ``"min"``; None where the user chooses.
    filter_label : str or None
        Label of the derivative filter; None if it cannot be set.
    filter_kind : {"time", "ratio", "fixed", "none"}
        A time constant; its ratio to the derivative time; `filter_ratio`; no filter.
    filter_ratio : float
        If it is fixed.
    added : bool
        In series form, the derivative factor is ``1 + td s / (tf s + 1)`` and not
        ``(td s + 1) / (tf s + 1)``.
    percent : {"none", "output", "both"}
        Which signals the gain refers to in percent of their range.
    signed : bool
        A negative gain can be entered; otherwise the action is reversed.
    derivative_allowed : bool
        False where no description of the derivative was available.
    weights : tuple of str
        Labels of the set-point weights of the proportional and derivative action, if there are any.
    source : str
        Where this is documented.
    """

    title: str
    structure: Literal["ideal", "series", "parallel"]
    gain: str
    integral: str
    derivative: str
    unit: str | None
    source: str
    band: bool = False
    rate: bool = False
    filter_label: str | None = None
    filter_kind: Literal["time", "ratio", "fixed", "none"] = "none"
    filter_ratio: float = 0.0
    added: bool = False
    percent: Literal["none", "output", "both"] = "none"
    signed: bool = False
    derivative_allowed: bool = True
    weights: tuple[str, ...] = ()


TEXTBOOK = "K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 3"
LOGIX_PIDE = "Rockwell Automation, publication 1756-RM006K-EN-P (2018), pages 80 and 81"
LOGIX_PID = (
    "Rockwell Automation, publication 1756-RM003N-EN-P (2011), page 519; units: Studio 5000 Logix "
    "Designer help, Specifying tuning"
)
DELTAV = (
    "J. Beall in Emerson Process Experts, Getting the Converted PID Values Right (2013); ALPHA: "
    "DeltaV Books Online, PID function block parameters"
)

LAYOUTS: dict[str, Layout] = {
    "ideal": Layout(
        "Ideal (standard, ISA) form, kp (1 + 1/(ti s) + td s/(tf s + 1))",
        "ideal", "kp", "ti", "td", None, TEXTBOOK,
        filter_label="tf", filter_kind="time", signed=True,
    ),
    "series": Layout(
        "Series (interacting) form, kc (1 + 1/(ti s)) (td s + 1)/(tf s + 1)",
        "series", "kc", "ti", "td", None, TEXTBOOK,
        filter_label="tf", filter_kind="time", signed=True,
    ),
    "parallel": Layout(
        "Parallel (independent) form, kp + ki/s + kd s/(tf s + 1)",
        "parallel", "kp", "ki", "kd", None, TEXTBOOK,
        filter_label="tf", filter_kind="time", signed=True,
    ),
    "proportional_band": Layout(
        "Ideal form with proportional band and repeats per time",
        "ideal", "proportional band", "reset", "rate", None, TEXTBOOK,
        band=True, rate=True, filter_label="filter", filter_kind="time", percent="both",
    ),
    "beckhoff_basic_pid": Layout(
        "Beckhoff TwinCAT, FB_BasicPID (FB_CTRL_PID: the same times as TIME)",
        "ideal", "fKp", "fTn", "fTv", "s",
        "Beckhoff Infosys, TwinCAT library Tc2_Utilities: FB_BasicPID",
        filter_label="fTd", filter_kind="time", signed=True,
    ),
    "emerson_deltav_standard": Layout(
        "Emerson DeltaV, PID block, FORM = Standard",
        "ideal", "GAIN", "RESET", "RATE", "s", DELTAV,
        filter_label="ALPHA", filter_kind="ratio", percent="both",
    ),
    "emerson_deltav_series": Layout(
        "Emerson DeltaV, PID block, FORM = Series",
        "series", "GAIN", "RESET", "RATE", "s",
        f"{DELTAV}; equation: Industrial Monitor Direct, DeltaV Series PID Form Equation Analysis",
        filter_label="ALPHA", filter_kind="ratio", added=True, percent="both",
    ),
    "honeywell_hc900": Layout(
        "Honeywell HC900, PID block (P and PI)",
        "ideal", "Prop Band", "Reset", "Rate", "min",
        "Honeywell, HC900 Hybrid Control Designer Function Block Reference Guide, revision 11 "
        "(2007), page 281",
        band=True, rate=True, percent="both", derivative_allowed=False,
    ),
    "honeywell_interactive": Layout(
        "Honeywell TDC 3000, interactive form, equation B",
        "series", "K", "T1", "T2", "min",
        "Equation of Honeywell's manual as quoted in control.com, Honeywell PID Equation Query "
        "(thread 4738)",
        filter_kind="fixed", filter_ratio=0.1, percent="both",
    ),
    "labview_pid": Layout(
        "National Instruments LabVIEW, PID VI",
        "ideal", "Kc", "Ti", "Td", "min",
        "National Instruments, LabVIEW PID Toolkit help, PID topologies",
        signed=True,
    ),
    "matlab_pid": Layout(
        "MATLAB, pid and pid2",
        "parallel", "Kp", "Ki", "Kd", "s",
        "MathWorks, Control System Toolbox reference: tunablePID2",
        filter_label="Tf", filter_kind="time", signed=True, weights=("b", "c"),
    ),
    "rockwell_pid_dependent": Layout(
        "Rockwell Logix 5000, PID instruction, dependent gains",
        "ideal", "Kc (.KP)", "Ti (.KI)", "Td (.KD)", "min", LOGIX_PID, percent="both",
    ),
    "rockwell_pid_independent": Layout(
        "Rockwell Logix 5000, PID instruction, independent gains",
        "parallel", "Kp (.KP)", "Ki (.KI)", "Kd (.KD)", "s", LOGIX_PID, percent="both",
    ),
    "rockwell_pide_dependent": Layout(
        "Rockwell Logix 5000, PIDE instruction, dependent gains",
        "ideal", "PGain (Kc)", "IGain (Ti)", "DGain (Td)", "min", LOGIX_PIDE, percent="both",
    ),
    "rockwell_pide_independent": Layout(
        "Rockwell Logix 5000, PIDE instruction, independent gains",
        "parallel", "PGain (Kp)", "IGain (Ki)", "DGain (Kd)", "min", LOGIX_PIDE, percent="both",
    ),
    "siemens_pid_compact": Layout(
        "Siemens S7-1200 and S7-1500, PID_Compact",
        "ideal", "Gain", "Ti", "Td", "s",
        "Siemens, S7-1200 system manual A5E02486680 (2012), section 9.2.2 (equation); PID control "
        "function manual A5E35300227-AC (2017), pages 258 to 261",
        filter_label="TdFiltRatio", filter_kind="ratio", percent="output",
        weights=("PWeighting", "DWeighting"),
    ),
}  # fmt: skip
"""Name -> parameters of a form. Forms of which no description was found are left out."""
