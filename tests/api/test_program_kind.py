"""Bounds are widened for programs with a sanitizer alone: which one this is, its build says too."""

import os
import re
from pathlib import Path

import pytest
from conftest import expect_memory, find_binary, is_instrumented, patient


def test_only_a_build_with_a_sanitizer_counts_as_one():
    cache = Path(os.environ.get("GRIDCAST_BUILD", find_binary().parent.parent)) / "CMakeCache.txt"
    if not cache.exists():
        pytest.skip(f"{cache} is not there")
    (sanitizers,) = re.findall(r"^GRIDCAST_SANITIZE:\w+=(.*)$", cache.read_text(), re.MULTILINE)
    assert is_instrumented() == (sanitizers != "")


def test_a_plain_program_is_held_to_its_bounds():
    if is_instrumented():
        pytest.skip("it has a sanitizer")
    assert patient(3) == 3
    expect_memory(9, 10)
    with pytest.raises(AssertionError):
        expect_memory(10, 10)
