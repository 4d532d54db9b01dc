"""Other processors, imitated: what is asked for is in force."""

import sys
from pathlib import Path

import processors
import pytest


def test_the_least_capable_processor_is_in_force():
    least = next(one for one in processors.variants() if one.name == "least capable")
    if least.missing:
        pytest.skip(f"{least.missing}: nothing to imitate it with")
    with processors.prepared(least) as (python, environment):
        assert {"OPENBLAS_CORETYPE", "NUMBA_CPU_NAME", "NUMBA_CACHE_DIR"} < set(environment)
        assert set(processors.in_force(python, environment)) == set(processors.SHOWN)


def test_one_that_is_not_in_force_is_refused():
    with pytest.raises((processors.NotInForceError, processors.subprocess.CalledProcessError)):
        processors.in_force(Path(sys.executable), {"OPENBLAS_CORETYPE": "Hasbeen"})


def test_words_choose_variants():
    def names(*words):
        return [one.name for one in processors.chosen(list(words))]

    assert names("least") == ["least capable"]
    assert names("python 3.13") == ["Python 3.13"]
    assert len(names("lowest", "newest")) == 2 * len(processors.PYTHONS)
    assert "least capable" in names()
    assert not {*names()} & {*names("lowest", "newest")}
    assert {"tests/simulation", "tests/test_response.py"} < {*processors.TESTS}
    with pytest.raises(ValueError, match="no variant is called vax"):
        names("vax")
