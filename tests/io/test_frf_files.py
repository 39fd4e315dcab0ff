import numpy as np
import pandas as pd
import pytest
import scipy.io
from numpy.testing import assert_allclose

import ctrl_realize as cr
from ctrl_realize.cli import main
from ctrl_realize.errors import DataError, DataWarning, FileFormatError, OptionError
from ctrl_realize.io import read_frf

F = np.array([0.5, 1.0, 2.0, 5.0, 10.0])
G = np.array([1.0, 0.9 - 0.3j, 0.5 - 0.6j, -0.1 - 0.4j, -0.1 + 0.05j])
PHASE = np.unwrap(np.angle(G))
OMEGA = 2 * np.pi * F


def written(header, *columns):
    rows = zip(*columns, strict=True)
    return header + "\n" + "".join(",".join(map(repr, map(float, row))) + "\n" for row in rows)


def check(frf, response=G):
    # rounding of exp, log10 and the change of units
    assert_allclose(frf.frequency_hz, F, rtol=1e-15)
    assert_allclose(frf.frdata[0, 0], response, rtol=0, atol=4e-15)


WRITTEN = {
    "as in this project": written("frequency_hz,magnitude,phase_deg", F, abs(G), np.rad2deg(PHASE)),
    "no units": written("f,gain,phase", F, abs(G), np.rad2deg(PHASE)),
    "no header": written("", F, abs(G), np.rad2deg(PHASE)),
    "radians": written("omega,mag,phase [rad]", OMEGA, abs(G), PHASE),
    "omega in Hz": written("w [Hz],mag,phase [rad]", F, abs(G), PHASE),
    "rad/s": written("frequency [rad/s],|G|,phase/deg", OMEGA, abs(G), np.rad2deg(PHASE)),
    "kHz": written("Freq (kHz),Mag,Phase (Degrees)", F / 1e3, abs(G), np.rad2deg(PHASE)),
    "MHz": written("freq_MHz,re,im", F / 1e6, G.real, G.imag),
    "mHz": written("Frequency [mHz],re,im", F * 1e3, G.real, G.imag),
    "decibels": written(
        "f_hz,magnitude_db,phase_deg", F, 20 * np.log10(abs(G)), np.rad2deg(PHASE)
    ),
    "real and imaginary": written("frequency,real,imag", F, G.real, G.imag),
    "both forms": written(
        "f,re,im,gain,phase", F, G.real, G.imag, abs(G), np.rad2deg(PHASE)
    ),
    "turned round": written("phase_deg,f,mag", np.rad2deg(PHASE), F, abs(G)),
    "downwards": written("f,re,im", F[::-1], G.real[::-1], G.imag[::-1]),
}  # fmt: skip


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN.keys())
def test_the_same_response_is_read_however_it_is_written(tmp_path, text):
    file = tmp_path / "a.csv"
    file.write_text(text)
    check(read_frf(file))


def test_columns_and_units_are_chosen(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text(written("a,b,c", OMEGA, 20 * np.log10(abs(G)), PHASE))
    frf = read_frf(
        file, frequency="a", magnitude=1, phase="c",
        frequency_unit="rad/s", magnitude_unit="dB", phase_unit="rad", name="bench",
    )  # fmt: skip
    check(frf)
    assert frf.name == "bench"


@pytest.mark.parametrize(
    ("text", "kwargs", "error", "match"),
    [
        (written("f,gain,phase", F, abs(G), PHASE), {}, OptionError, "in degrees or in radians"),
        # a dead time turns the phase by more than 2 pi, and half the magnitude by more than 60 deg
        (
            written("f,gain,phase", F, abs(G), 10 * PHASE),
            {},
            OptionError,
            "in degrees or in radians; give phase_unit",
        ),
        # MATLAB's bode gives rad/s and degrees, python-control rad/s and radians
        (
            written("omega,mag,phase", OMEGA, abs(G), 10 * PHASE),
            {},
            OptionError,
            "in degrees or in radians; give phase_unit",
        ),
        (written("f_mhz,re,im", F, F, F), {}, OptionError, "in 'mhz'; give frequency_unit='mHz'"),
        (written("f,gain,phase_deg", F, -F, F), {}, OptionError, "negative values; is it in dB"),
        # 20 dB above 1 were read as a gain of 20
        (written("f,gain [dB V/V],phase_deg", F, 20 + F, PHASE), {}, OptionError, "is it in dB"),
        (written("f,gain [dBV],phase_deg", F, 20 + F, PHASE), {}, OptionError, "is in 'dbv'"),
        (written("f,gain_dB,phase_deg", F, 1e3 * F, PHASE), {}, DataError, "10000 dB"),
        (written("f,gain,phase [turns]", F, F, F), {}, OptionError, "in 'turns'; give phase_unit"),
        (written("f [rpm],re,im", F, F, F), {}, OptionError, "in 'rpm'; give frequency_unit"),
        (written("a,re,im", F, F, F), {}, OptionError, "which column is the frequency"),
        (written("f,re,b", F, F, F), {}, OptionError, "which column is the response.*2 'b'"),
        (written("f,re,im,re", F, F, F, F), {}, OptionError, "2 columns that could be real"),
        (written("f,re,im", -F, F, F), {}, DataError, "expected a value >= 0"),
        (written("f,re,im,coh", F, F, F, F), {}, DataError, "a.csv: coherence runs from"),
        (written("f,re,im", F, F, F * np.nan), {}, DataError, "line 2: 'nan': a value is missing"),
        (written("f,re,im", F, F, F), {"phase_unit": "turns"}, OptionError, "phase_unit='turns'"),
        (written("f,re,im", F, F, F), {"magnitude_unit": "V"}, OptionError, "'abs', 'dB'"),
        (written("f,re,im", F, F, F), {"frequency_unit": "GHz"}, OptionError, "'Hz', 'kHz'"),
        (written("f [GHz],re,im", F, F, F), {}, OptionError, "'mHz', 'Hz', 'kHz', 'MHz' or"),
        (written("f,re,im", F, F, F), {"frequency": "w"}, OptionError, "frequency='w'"),
        ("hello\n", {}, FileFormatError, "numeric columns"),
    ],
)  # fmt: skip
def test_what_is_not_clear_is_asked(tmp_path, text, kwargs, error, match):
    file = tmp_path / "a.csv"
    file.write_text(text)
    with pytest.raises(error, match=match):
        read_frf(file, **kwargs)


def test_complex_arrays_are_read(tmp_path):
    # the .mat reader once took the imaginary part off without a word
    for name in ("G", "H", "frf", "response"):
        np.savez(tmp_path / "a.npz", f=F, **{name: G})
        check(read_frf(tmp_path / "a.npz"))
    struct = {"freq": F, "H": G[:, None]}
    scipy.io.savemat(tmp_path / "a.mat", {"meas": struct}, do_compression=True)
    check(read_frf(tmp_path / "a.mat"))


@pytest.mark.parametrize(
    ("head", "form"),
    [
        ("f,G", "{0.real:.17g}{0.imag:+.17g}j"),
        ("f,response", "({0.real:.17g} {0.imag:+.17g}i)"),
        ("f;H", "{0.real:.17g} {0.imag:+.17g} j"),
        ("f,G", "({0})"),
    ],
)
@pytest.mark.parametrize("decimal", ".,")
def test_complex_numbers_are_read_as_programs_write_them(tmp_path, head, form, decimal):
    mark = ";" if decimal == "," else head[1]
    rows = [f"{f}{mark}{form.format(g)}".replace(".", decimal) for f, g in zip(F, G, strict=True)]
    file = tmp_path / "a.csv"
    file.write_text("\n".join([head.replace(head[1], mark), *rows, ""]))
    check(read_frf(file))
    file.write_text(file.read_text().replace(rows[3], f"5{decimal}0{mark}1{decimal}2+k"))
    with pytest.raises(DataError, match=r"line 5: '1[.,]2\+k': is not a number"):
        read_frf(file)


def test_a_coherence_in_per_cent_is_read(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text(written("f,re,im,coherence [%]", F, G.real, G.imag, np.linspace(100, 20, 5)))
    assert_allclose(read_frf(file).coherence, np.linspace(1, 0.2, 5), rtol=1e-15)


def test_coherence_and_std_come_along_and_a_cut_last_line_does_not(tmp_path):
    file = tmp_path / "two.parts.csv"
    coherence, std = np.linspace(1, 0.2, 5), np.linspace(0.01, 0.1, 5)
    file.write_text(written("f,re,im,coherence,std", F[::-1], G.real, G.imag, coherence, std))
    frf = read_frf(file)
    assert_allclose(frf.coherence, coherence[::-1], rtol=0)
    assert_allclose(frf.std, std[::-1], rtol=0)
    assert frf.name == "two_parts"
    assert frf.trusted(0.9).frequency_hz[0] == F[4]
    file.write_text(written("f,re,im", F, G.real, G.imag) + "20.0,0.")
    with pytest.warns(DataWarning, match="has 2 of 3 cells"):
        check(read_frf(file))


@pytest.mark.parametrize("unit", ["dB", "%", "deg"])
def test_a_std_in_another_unit_than_the_response_is_refused(tmp_path, unit):
    # 0.1 dB of a response of 0.1 was read as a std of 0.1
    file = tmp_path / "a.csv"
    head = f"f [Hz],gain [dB],phase [deg],std [{unit}]"
    file.write_text(written(head, F, 20 * np.log10(abs(G)), np.angle(G, deg=True), 0.1 + 0 * F))
    with pytest.raises(OptionError, match="standard deviation of the complex response"):
        read_frf(file)
    file.write_text(file.read_text().replace("std", "spread"))
    check(read_frf(file))


def test_every_measured_frequency_response_is_read(shared_data):
    files = list(shared_data.rglob("*frf*.csv"))
    assert len(files) >= 5
    for file in files:
        response = read_frf(file)
        frequency, magnitude, phase = np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)
        assert_allclose(response.frequency_hz, frequency, rtol=0)
        assert_allclose(np.abs(response.complex), magnitude, rtol=1e-15)
        turns = (np.angle(response.complex, deg=True) - phase) / 360
        # angle() and exp() round, and 2160 degrees cost three digits
        assert_allclose(turns, np.round(turns), atol=1e-13)


def test_a_frequency_response_in_place_of_a_record_is_named(tmp_path, capsys):
    file = tmp_path / "bench.csv"
    file.write_text(written("f [Hz],magnitude,phase [deg]", F, abs(G), np.rad2deg(PHASE)))
    told = r"holds a frequency response .*read_frf\('.*bench\.csv'\) reads it, and cr\.fit_frf"
    with pytest.raises(OptionError, match=told):
        cr.read_record(file)
    with pytest.raises(DataError, match="fit_frf makes a model of a frequency response"):
        cr.identify(read_frf(file))
    assert main(["look", str(file)]) == 0
    said = capsys.readouterr().out
    assert "<MeasuredFRF 'bench': 5 points, 0.5...10 Hz>, a frequency response" in said
    assert "cr.fit_frf(cr.read_frf(" in said
    assert said.splitlines()[2].split()[-1] == "frequency"


def test_json_and_tables_are_named_with_what_reads_them(tmp_path):
    file = tmp_path / "log.json"
    file.write_text('{"t": [0, 1, 2], "u": [0, 1, 1], "y": [0, 0, 1]}')
    with pytest.raises(FileFormatError, match=r"is JSON; expected a table .*json\.load reads it"):
        cr.read_record(file)
    with pytest.raises(DataError, match=r"got a DataFrame; Record\.from_frame\(frame"):
        cr.identify(pd.DataFrame({"u": F, "y": F}))
    with pytest.raises(DataError, match=r"numpy\.ravel makes one of a column"):
        cr.Record(F[:, None], F, F)
