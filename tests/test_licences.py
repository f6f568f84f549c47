"""Licences of what pomona is built of: a new dependency must be under a permissive one, or be named with a reason."""

import shutil

import pytest
from audit.licences import (
    APART,
    BUNDLED,
    EXCEPTIONS,
    brought,
    bundling,
    crate_licences,
    is_allowed,
    package_licences,
    wrong_licences,
)


@pytest.mark.skipif(shutil.which("cargo") is None, reason="needs cargo")
def test_crates_are_under_permissive_licences():
    found = crate_licences()
    assert any(name.startswith("nalgebra ") for name in found)
    assert wrong_licences(found) == []


def test_packages_are_under_permissive_licences():
    found = package_licences()
    assert {"numpy", "scipy", "av", "rosbags", "onnxruntime", "typer"} <= found.keys()
    assert not {"pytest", "hypothesis"} & set(brought())
    assert wrong_licences(found) == []
    assert set(APART) <= set(brought())
    assert set(EXCEPTIONS) <= found.keys()


def test_what_wheels_carry_besides_their_package_is_known():
    found = bundling()
    assert "numpy" in found
    assert set(found) <= BUNDLED.keys()


@pytest.mark.parametrize(
    ("expression", "allowed"),
    [
        ("MIT", True),
        ("MIT/Apache-2.0", True),
        ("GPL-3.0-only", False),
        ("GPL-3.0-only OR MIT", True),
        ("GPL-3.0-only AND MIT", False),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", True),
        ("(MIT OR Apache-2.0) AND GPL-2.0-only", False),
        ("Apache-2.0 WITH LLVM-exception OR GPL-2.0-only", True),
        ("GPL-2.0-only WITH Classpath-exception-2.0", False),
        ("MIT (see file)", False),
        ("", False),
    ],
)
def test_expressions_of_licences(expression, allowed):
    assert is_allowed(expression) is allowed
