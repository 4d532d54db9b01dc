"""Reserved words of the three languages, of their libraries, and of two vendors of PLCs.

Structured text ignores case, and its compilers also reserve the names of library blocks: a variable called ``integral``
or ``action`` does not compile. Names here are in small letters.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

LONGEST_NAME = 32  # characters that every compiler distinguishes

IEC_61131_3 = """
abstract action and any any_bit any_bool any_char any_chars any_date any_derived any_duration any_elementary any_int
any_magnitude any_num any_real any_signed any_string any_unsigned array at begin bool by byte case char class
configuration constant continue date date_and_time dint do dt dword else elsif end_action end_case end_class
end_configuration end_for end_function end_function_block end_if end_interface end_method end_namespace end_program
end_repeat end_resource end_step end_struct end_transition end_type end_var end_while exit extends f_edge false final
for from function function_block goto if implements initial_step int interface internal interval ldate
ldate_and_time ldt lint lreal ltime ltime_of_day ltod lword method mod namespace non_retain not null of on or overlap
override priority private program protected public r_edge read_only read_write real ref ref_to repeat resource retain
return single sint step string struct super task then this time time_of_day to tod transition true type udint uint
ulint until using usint var var_access var_config var_external var_global var_in_out var_input var_output var_temp
while with word wchar wstring xor
"""
INSTRUCTION_LIST = """
add andn cal calc calcn cd clk cu div eq ge gt in jmp jmpc jmpcn ld ldn le lt mul ne orn pt pv r r1 ret retc retcn s s1
st stn sub xorn d ds dref en eno l n p sd sl q et
"""
STANDARD_LIBRARY = """
abs acos asin atan atan2 bcd ceil concat cos ctd ctu ctud date_to_string delete derivative divtime exp expt f_trig find
floor hysteresis insert integral is_valid is_valid_bcd left len limit ln log lower_bound max mid min move multime mux
pack pid r_trig ramp replace reset right rol ror round rs rs1 rtc sel sema shl shr sign sin split sqrt sr tan tof ton tp
trunc unpack upper_bound
"""
VENDORS = """
__delete __isvalidref __new __queryinterface __querypointer __try __catch __finally __endtry __vfcall __xadd adr adrinst
analog_alarm any_type bit bitadr bitsizeof blink charcurve cmp_and_swap derivation deriv end_get end_property end_set
end_union freq_measure gen get global implementation indexof ini integral_real international intrinsic lib_manager
limitalarm lin_trafo long ltof lton ltp param params persistent pi pid_fixcycle plc_prg pointer pou pro property pvoid
ramp_int ramp_real reference region end_region rctrl sizeof set statistics_int statistics_real stru system systime
testandset task_info t_maxstring udt union uxint var_generic var_inst var_persistent var_stat variance virtual wsystem
xchg xint xword xsizeof and_then or_else db_any struct_end variant void any_block block_db block_fb
block_fc block_sdb block_sfb block_sfc counter data_block end_data_block end_organization_block organization_block
label end_label const end_const nil ok timer s5time
"""
C99 = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false
main nan infinity y0 y1 yn j0 j1 jn gamma index exp log pow errno assert
"""
PYTHON_WORDS = """
and as assert async await break class continue def del elif else except false finally for from global if import in is
lambda none nonlocal not or pass raise return true try while with yield self zip max abs print range exec eval
"""
RESERVED = frozenset(
    " ".join((IEC_61131_3, INSTRUCTION_LIST, STANDARD_LIBRARY, VENDORS, C99, PYTHON_WORDS)).split()
)
# conversions such as REAL_TO_INT, and typed functions such as ADD_REAL
FAMILIES = re.compile(
    r"[a-z]+[0-9]*(_bcd)?_to_[a-z0-9_]+|(abs|add|div|eq|expt?|g[et]|l[et]|mul|ne|sub|limit|max|min|mux|sel|move|trunc|"
    r"sqrt|ln|log|a?sin|a?cos|a?tan|and|x?or|not|mod|ct[ud]{1,2})_[a-z]+"
)
OWN = frozenset(("tested", "worst", "off", "k", "s", "state", "reset", "selftest"))  # names of the self-tests


def identifier(name: str, taken: Iterable[str] = ()) -> str:
    """Check a name for code: letters, digits and single underscores, as all three languages allow.

    Parameters
    ----------
    name : str
        Name of a controller, in small letters.
    taken : iterable of str, optional
        Further names that the code uses.

    Returns
    -------
    str
        The name.

    Raises
    ------
    ValueError
        For a name that is not an identifier, and for a reserved word.

    Examples
    --------
    >>> from pidalab.plant.code.words import identifier
    >>> identifier("level_2")
    'level_2'
    """
    plain = isinstance(name, str) and re.fullmatch(r"[a-z](_?[a-z0-9])*", name) and len(name) <= LONGEST_NAME
    if plain:
        capitals = "".join(word.capitalize() for word in name.split("_"))  # the class in Python
        reserved = name in RESERVED | OWN or FAMILIES.fullmatch(name) or name.startswith("test_")
        if not reserved and {name, capitals}.isdisjoint(taken):
            return name
    raise ValueError(
        "name must be an identifier of small letters, digits and single underscores that begins with a letter, has at "
        f"most {LONGEST_NAME} characters and is no word of a language, a library or this code, found {name!r:.60}"
    )
