"""Names and comments that every language accepts."""

from __future__ import annotations

import keyword
import os
import re
import unicodedata
from collections.abc import Container
from pathlib import Path

from ..errors import OptionError

TYPES = """
bool byte char dint dt date date_and_time dword int ldate ldate_and_time ldt lint lreal ltime
ltime_of_day ltod lword real sint string time time_of_day tod udint uint ulint usint wchar word
wstring
"""
"""Elementary types: IEC 61131-3:2003 and 2013, table 10."""
STANDARD = """
any any_bit any_chars any_date any_derived any_duration any_elementary any_int any_magnitude any_num
any_real any_signed any_string any_unsigned
abs acos add asin atan atan2 concat cos delete div divtime eq exp expt find ge gt insert le left len
limit ln log lt max mid min mod move mul multime mux ne replace right rol ror sel shl shr sin sqrt
sub tan trunc
add_dt_time add_ltime add_time add_tod_time concat_date concat_date_tod concat_dt concat_tod
day_of_week div_ltime div_time is_valid is_valid_bcd lower_bound mul_ltime mul_time split_date
split_dt split_tod sub_date_date sub_dt_dt sub_dt_time sub_ltime sub_time sub_tod_time sub_tod_tod
upper_bound
ctd ctu ctud f_trig r_trig rs rtc sema sr tof ton tp
"""
"""Generic types, standard functions and function blocks: tables 11 and 22 to 46 of 2013, and those
of 2003 that were dropped. Their names are keywords: annex C of 2003, table C.2."""
WORDS = """
abstract action and array at by case class configuration constant continue do else elsif en end
end_action end_case end_class end_configuration end_for end_function end_function_block end_if
end_interface end_method end_namespace end_program end_repeat end_resource end_step end_struct
end_transition end_type end_var end_while eno exit extends f_edge false final for from function
function_block if implements initial_step interface internal interval method namespace non_retain
not null of on or overlap override priority private program protected public r_edge read_only
read_write ref ref_to repeat resource retain return single step struct super task then this to
transition true type until using var var_access var_config var_external var_global var_in_out
var_input var_output var_temp while with xor
andn cal calc calcn jmp jmpc jmpcn ld ldn orn ret retc retcn st stn xorn
"""
"""Keywords of all languages of the standard, and operators of its instruction list."""
C = """
auto break char const default double enum extern float goto inline int long register restrict short
signed sizeof static switch typedef union unsigned void volatile
"""
MATLAB = "catch classdef end function otherwise parfor persistent spmd"
RESERVED = frozenset(
    f"{TYPES} {STANDARD} {WORDS} {C} {MATLAB}".split()
    + [word.lower() for word in (*keyword.kwlist, *keyword.softkwlist, "type")]
)
"""Words of any of the languages that are no names (in lower case)."""
CONVERSION = re.compile(rf"({'|'.join(TYPES.split())}|bcd|)_?to_({'|'.join(TYPES.split())}|bcd)")
"""Names of the standard's conversion functions, such as ``real_to_int`` and ``to_int``."""
LONGEST = 48
"""Characters of a name: MATLAB cuts a variable at 63, and the scripts add up to 14."""


def identifier(name: str, fallback: str, taken: Container[str] = ()) -> str:
    """Turn a name into an identifier that all languages accept.

    Parameters
    ----------
    name, fallback : str
        `fallback` is used where no letter of `name` remains, and before a leading digit.
    taken : container of str, optional
        Further names that are in use.

    Examples
    --------
    >>> from ctrl_realize.export.names import identifier
    >>> identifier("FIC 101.OP", "plant"), identifier("für", "plant"), identifier("TON", "plant")
    ('FIC_101_OP', 'fur', 'TON_1')
    """
    if not isinstance(name, str):
        raise OptionError(f"name={name!r}; expected a string")
    # IEC 61131-3 allows ASCII letters, digits and single underscores.
    ascii_only = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    text = re.sub(r"[^A-Za-z0-9]+", "_", ascii_only).strip("_") or fallback
    if text[0].isdigit():
        text = f"{fallback}_{text}"
    text = text[:LONGEST].rstrip("_")
    lower = text.lower()
    refused = lower in RESERVED or text in taken or CONVERSION.fullmatch(lower)
    return f"{text}_1" if refused else text


def one_line(text: str) -> str:
    r"""Text for a label, or a comment to the end of its line: ASCII, no control characters.

    Examples
    --------
    >>> from ctrl_realize.export.names import one_line
    >>> one_line("first\r\nsecond für")
    'first  second f?r'
    """
    return re.sub(r"[\x00-\x1f\x7f]", " ", text.encode("ascii", "replace").decode())


def plain(text: str) -> str:
    """Text for a comment on one line that no language ends early.

    Examples
    --------
    >>> from ctrl_realize.export.names import plain
    >>> plain("first */ second *) third")
    'first ? second ? third'
    """
    return re.sub(r"\*\)|\*/|/\*|\(\*|\"\"\"|\\", "?", one_line(text))


def ending(path: str | os.PathLike[str], suffix: str) -> Path:
    """Path of a file whose name ends in a suffix."""
    target = Path(path)
    if target.suffix != suffix:
        raise OptionError(f"path={str(target)!r}; expected a name that ends in {suffix}")
    return target
