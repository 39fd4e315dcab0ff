"""The data sets: every fact is stored here once; pages and cards are made from it."""

from __future__ import annotations

from .info import DataFile, DatasetInfo

_FDITOOLS = "T. Beauduin and W. Ohnishi, FdiTools, github.com/HoriFujimotoLab/FdiTools"
_FDITOOLS_LICENCE = (
    "Copyright (c) 2016 Hori-Fujimoto Lab, Thomas Beauduin, and Wataru Ohnishi, who measured the "
    "data and publish them in their repository"
)

TCLAB = DatasetInfo(
    name="tclab",
    plant="Temperature Control Lab: two transistors on a small board as heaters, two thermistors",
    files=(
        DataFile(
            "steps",
            "steps.csv",
            "record",
            ("heater [PWM]",),
            ("temperature [K]",),
            571,
            1.00375,
            {"resample": True},
        ),
        DataFile(
            "two_heaters",
            "two_heaters.csv",
            "record",
            ("heater 1 [%]", "heater 2 [%]"),
            ("temperature 1 [degC]", "temperature 2 [degC]"),
            599,
            1.00151,
            {
                "input": ["heater 1 [%]", "heater 2 [%]"],
                "output": ["temperature 1 [degC]", "temperature 2 [degC]"],
                "resample": True,
            },
        ),
    ),
    dead_time_band=(0.0, 5.0),
    dead_time_source="our look at the first motion",
    facts=(
        "the heater warms first itself and then the sensor: two lags and at most a short dead "
        "time; fits of one lag and a dead time, as in courses, give 16 to 22 s",
        "steps: 0 to 150, 10 and 150 of 255; the temperature is rounded to 0.32 K, so its first "
        "visible change, 6 to 7 s after the step, is late",
        "two_heaters: six steps of both heaters; rounded to 0.03 degC",
        "the time stamps deviate from a uniform grid by up to 0.09 (steps) and 0.2 samples",
    ),
    origin=(
        "github.com/APMonitor/arduino, folder 2_Regression; measured by the group of J. D. "
        "Hedengren, Brigham Young University"
    ),
    licence="Apache-2.0",
    licence_note="given by those who measured the data, in their repository",
    changes="header line added; numbers and time stamps are those of the source",
    citation=(
        "J. Park, R. A. Martin, J. D. Kelly, J. D. Hedengren, Benchmark temperature "
        "microcontroller for process dynamics and control, Computers and Chemical Engineering "
        "135, 2020, 106736"
    ),
)

MOTOR_BENCH = DatasetInfo(
    name="motor_bench",
    plant="motor bench with a flexible coupling, excited by a Schroeder multisine",
    files=(
        DataFile(
            "multisine",
            "multisine.csv",
            "record",
            ("motor torque [-]",),
            ("motor angle [-]",),
            50000,
            0.0004,
        ),
    ),
    dead_time_band=(0.5 * 0.0004, 1.1 * 0.0004),
    dead_time_source="our fit of its frequency response, about one sample",
    facts=(
        "20 periods of 2500 samples, with a line at each whole frequency from 11 to 250 Hz; the "
        "first period contains the transient: spectral_frf(record, period=2500)",
        "resonance at 77 Hz, antiresonance at 53 Hz",
    ),
    origin=(
        "github.com/HoriFujimotoLab/FdiTools, Examples; measured by T. Beauduin (KU Leuven, 2014)"
    ),
    licence="MIT",
    licence_note=_FDITOOLS_LICENCE,
    changes="one of two outputs, written as text; signals have the scale of the source",
    citation=_FDITOOLS,
)

STAGE = DatasetInfo(
    name="stage",
    plant="precision stage, from its drive to the position at two places",
    files=(
        DataFile("output_1", "frf_output_1.csv", "frf", ("drive [-]",), ("position 1 [-]",), 423),
        DataFile("output_2", "frf_output_2.csv", "frf", ("drive [-]",), ("position 2 [-]",), 423),
    ),
    dead_time_band=None,
    dead_time_source="none in the authors' model; the phase falls further above 150 Hz",
    facts=(
        "poles of the authors' model, in rad/s: -131.1 +- 1868.1j, -22.70 +- 559.8j, "
        "-5.447 +- 191.4j, -2.101",
        "0.1 to 1000 Hz; the points below 1 Hz scatter by 15 to 27 %",
    ),
    origin="github.com/HoriFujimotoLab/FdiTools, Examples; measured by the Hori-Fujimoto Lab",
    licence="MIT",
    licence_note=_FDITOOLS_LICENCE,
    changes="written as magnitude and unwrapped phase with nine digits",
    citation=_FDITOOLS,
)

SUGAR_ACTUATOR = DatasetInfo(
    name="sugar_actuator",
    plant="control valve of a sugar factory in operation: command, stem, flow, pressures",
    files=(
        DataFile(
            "first_half_hour",
            "first_half_hour.csv",
            "record",
            ("command [%]",),
            ("stem [%]", "flow [-]"),
            1800,
            1.0,
            {"input": "command [%]", "output": ["stem [%]", "flow"]},
        ),
    ),
    dead_time_band=None,
    dead_time_source="not known",
    facts=(
        "operating data in a closed loop, whose set point is not recorded; columns that are not "
        "in the record: pressures before and behind the valve in kPa, temperature in degC",
        "command, stem and flow are rounded to 0.1",
        "the stem follows the command within about a second, with a gain that depends on the level",
    ),
    origin=(
        "DAMADICS, a European research network, which published data of the Lublin sugar factory "
        "as a public benchmark in 2002; copied from github.com/dlaredo/ValveActuator-DAMADICS-"
    ),
    licence="BSD-3-Clause",
    licence_note=(
        "of the repository that the copy comes from; its author did not measure the data, see "
        "the LICENSE file beside them"
    ),
    changes="the first 1800 of 3600 s; names of the columns",
    citation=(
        "M. Bartys, R. Patton, M. Syfert, S. de las Heras, J. Quevedo, Introduction to the "
        "DAMADICS actuator FDI benchmark study, Control Engineering Practice 14, 2006, 577-596"
    ),
)

GAS_FURNACE = DatasetInfo(
    name="gas_furnace",
    plant="gas furnace, from the feed of gas to the carbon dioxide in the exhaust (series J)",
    files=(
        DataFile(
            "series_j",
            "series_j.csv",
            "record",
            ("gas feed [ft3/min]",),
            ("carbon dioxide [%]",),
            296,
            9.0,
        ),
    ),
    dead_time_band=(27.0, 27.0),
    dead_time_source="of three samples, Box and Jenkins",
    facts=(
        "model of Box and Jenkins, without means: (1 - 0.57 z^-1) y(t) = "
        "-(0.53 + 0.37 z^-1 + 0.51 z^-2) u(t - 3): a gain of -3.28",
        "the gas feed is random, its deviation from a mean is given; the disturbances are coloured",
        "several lags and a shorter dead time explain the record as well: identify reports an "
        "interval of 0 to 24 s and says so",
    ),
    origin="printed in the book of Box and Jenkins",
    licence="facts",
    licence_note="a table of measured numbers, printed in 1970: facts, to which nobody has a right",
    changes="time axis added (samples of 9 s)",
    citation=(
        "G. E. P. Box and G. M. Jenkins, Time Series Analysis: Forecasting and Control, "
        "Holden-Day, 1970, series J"
    ),
)

SIMULATED_VALVE = DatasetInfo(
    name="simulated_valve",
    plant="simulated control valve of bench.valve: a step and a stepped sine, with known truth",
    files=(
        DataFile(
            "step",
            "step.csv",
            "record",
            ("current (simulated) [mA]",),
            ("displacement (simulated) [mm]",),
            2560,
            1 / 1280,
        ),
        DataFile(
            "frf",
            "frf.csv",
            "frf",
            ("current (simulated) [mA]",),
            ("displacement (simulated) [mm]",),
            60,
        ),
    ),
    dead_time_band=(37 / 1280, 37 / 1280),
    dead_time_source="exact, 37 samples",
    facts=(
        "gain 0.125 mm/mA; poles at 2.2 Hz, 8 Hz (damping 0.7), 30 Hz and 10 kHz",
        "frequency response: 60 points from 0.1 to 20 Hz, three repeats of each, with coherence "
        "and standard deviation",
    ),
    origin="this package: bench.valve(pre_step_time=0.5, hold=1.5)",
    licence="BSD-3-Clause",
    licence_note="as the package",
    changes="rounded to five decimals",
    citation="this package",
    simulated=True,
)

DATASETS = (GAS_FURNACE, MOTOR_BENCH, SIMULATED_VALVE, STAGE, SUGAR_ACTUATOR, TCLAB)
"""All data sets, by name."""
