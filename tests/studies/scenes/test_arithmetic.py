"""Expressions of scene files: arithmetic and nothing else."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from studies.scenes.arithmetic import (
    LONGEST,
    LONGEST_FIELD,
    ExpressionError,
    Field,
    evaluated,
    is_expression,
    names,
)

VALUES = {"a": 3.0, "n": 4, "rule": "mixed", "on": True}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2*$a", 6.0),
        ("$a", 3.0),
        ("$n", 4),
        ("$rule", "mixed"),
        ("$on", True),
        ("-$a^2", -9.0),
        ("2^3^2*$a/$a", 512.0),
        ("($a + 1) * ($n - 2) / 4", 2.0),
        ("1e-3*$a", 3e-3),
        (".5*$a", 1.5),
        ("--$a", 3.0),
        ("$a - -$a", 6.0),
        ("sqrt($a^2 + $n^2)", 5.0),
        ("max($a, min($n, 2))", 3.0),
        ("sin(pi/2)*$a", 3.0),
        ("atan($a/$a)", math.pi / 4),
        ("2/2/2*$n", 2.0),
        ("10-4-3+$a", 6.0),
        (" $a\n +1", 4.0),
        ("$rule == 'mixed'", True),
        ("$rule != 'mixed'", False),
        ("$a == 3 and not $n > 4", True),
        ("$a > 3 or $on", True),
        ("$on == ($n < 4)", False),
        ("if($rule == 'mixed', $a, 1/0)", 3.0),
        ("2*if($a > 3, 1, if($on, 2, 3))", 4),
        ("if($a > 3, 'one', $rule)", "mixed"),
    ],
)
def test_an_expression_has_the_value_of_arithmetic(text: str, value: object) -> None:
    found = evaluated(text, VALUES)
    assert found == pytest.approx(value) if isinstance(value, float) else found == value


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("2*$b", r"\$b is no parameter; the scene has \$a, \$n, \$rule, \$on"),
        ("$a +", r"arithmetic: numbers, 'words', \$parameters, pi"),
        ("($a", "arithmetic"),
        ("$a)", "arithmetic"),
        ("2 $a", "arithmetic"),
        ("$a$n", "arithmetic"),
        ("$a ** 2", r"from '\*\* 2' on"),
        ("$a // 2", r"from '// 2' on"),
        ("2j*$a", "2j cannot be read"),
        ("($a, 2)", r"\(\$a, 2\) cannot be read"),
        ("sqrt(*$a)", "cannot be read"),
        ("2*parameter__a+$a", "from 'parameter__a"),
        ("$rule * 2", "no expression"),
        ("$on + 1", "only numbers"),
        ("$rule < 'n'", "cannot compare 'mixed' and 'n'"),
        ("$rule == 2", "cannot compare 'mixed' and 2"),
        ("$on == 1", "cannot compare true and 1"),
        ("$rule == mixed", "'mixed' for a word"),
        ("$rule == 'mixed", 'from "\'mixed" on'),
        ("$a and $on", r"\$a is 3.0: must be true or false"),
        ("if($a, 1, 2)", r"\$a is 3.0: must be true or false"),
        ("if($on, 1)", "a condition and two values, not 2"),
        ("$a if $on else 2", "cannot be read"),
        ("$a < 2 < 4", "must compare two values"),
        ("$a = 2", "arithmetic"),
        ("$a / 0", "no value"),
        ("$a / ($a - 3)", "no value"),
        ("sqrt(-$a)", "no value"),
        ("log($a - 3)", "no value"),
        ("$a^1000", "no value"),
        ("1e308*10*$a", "finite"),
        ("foo($a)", "foo is unknown"),
        ("b*$a", r"write \$b for a parameter"),
        ("sqrt($a, 2)", "takes 1 number"),
        ("max($a)", "takes 2 number"),
        ("__import__('os')+$a", "unknown|cannot be read"),
        ("$a.real", "cannot be read"),
        ("$a[0]", "cannot be read"),
        ("(" * 200 + "$a" + ")" * 200, "characters long"),
        ("$a" + "+1" * LONGEST, "characters long"),
        ("9^9^9^9*$a", "no value"),
    ],
)
def test_what_is_no_arithmetic_is_refused_with_its_reason(text: str, reason: str) -> None:
    with pytest.raises(ExpressionError, match=reason):
        evaluated(text, VALUES)


def test_names_are_those_after_a_dollar() -> None:
    assert names("2*$a + $long_name3/sqrt($a)") == {"a", "long_name3"}
    assert is_expression("$a") and not is_expression("a") and not is_expression(3)


def test_text_of_any_kind_has_a_value_or_a_reason() -> None:
    """A thousand texts of the characters of the grammar: none ends in another way."""
    rng = random.Random(3)
    kinds = [
        "$a",
        "$n",
        "2",
        "1.5e3",
        "+",
        "-",
        "*",
        "/",
        "^",
        "(",
        ")",
        ",",
        "sqrt",
        "max",
        "pi",
        " ",
        "if(",
        "==",
        "!",
        "'a'",
        " and ",
        "not ",
    ]
    ended = {True: 0, False: 0}
    for _ in range(1000):
        text = "".join(rng.choices(kinds, k=rng.randint(1, 12)))
        try:
            value = evaluated(text, VALUES)
        except ExpressionError:
            ended[False] += 1
        else:
            assert isinstance(value, str) or math.isfinite(value)
            ended[True] += 1
    assert min(ended.values()) > 20


@pytest.mark.parametrize("text", ["(" * 95 + "$a" + ")" * 95, "1+" * 49 + "$a"])
def test_parentheses_and_sums_of_usual_length_are_read(text: str) -> None:
    assert evaluated(text, VALUES) == pytest.approx(3.0 + text.count("+"))


@pytest.mark.parametrize(
    "text", ["-" * 198 + "$a", "1+" * 99 + "$a", "abs(" * 30 + "-" * 40 + "$a" + ")" * 30]
)
def test_operations_deep_inside_one_another_are_one_clear_error(text: str) -> None:
    with pytest.raises(ExpressionError, match="at most 50 operations inside one another: use der"):
        evaluated(text, VALUES)


X = np.array([[0.0, 1.0, 4.0], [2.0, 2.0, -1.0]])


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("$a*(1 - (x/$n)^2)", [3.0, 2.8125, 0.0]),
        ("-$a^2*y", [-18.0, -18.0, 9.0]),
        ("$low^2*x", [0.0, 4.0, 16.0]),
        ("if(x > 0 and $on, sqrt(x), $low)", [-2.0, 1.0, 2.0]),
        ("if(not (x > 0 or y < 0), $a, y)", [3.0, 2.0, -1.0]),
        ("if($rule == 'mixed', max(x, $a), 1/0)", [3.0, 3.0, 4.0]),
        ("2^-x*$n + abs(y)", [6.0, 4.0, 1.25]),
        ("if(x > 0, log(x), 0)", [0.0, 0.0, math.log(4.0)]),
        ("sin(pi*x/2)*min($a, y)", [0.0, 2.0, 0.0]),
        ("5", [5.0, 5.0, 5.0]),
    ],
)
def test_an_expression_of_the_position_is_a_function_of_it(text: str, values: list[float]) -> None:
    bare = evaluated(text, VALUES | {"low": -2.0}) if is_expression(text) or "if" in text else text
    assert "$" not in bare
    assert np.allclose(Field(bare)(X), values, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("x*$rule", "only numbers"),
        ("x > $a", "is a field: only numbers"),
        ("x and $on", "x is a field: must be true or false"),
        ("if(x, 1, $a)", "x is a field: must be true or false"),
        ("x*q + $a", "q is unknown"),
        ("x(2)*$a", "x is unknown"),
        ("x*$b", r"\$b is no parameter"),
        ("$a*x/0*(1/0)", "no value"),
    ],
)
def test_what_is_no_function_of_position_is_refused(text: str, reason: str) -> None:
    with pytest.raises(ExpressionError, match=reason):
        evaluated(text, VALUES)


def test_fields_cannot_be_computed_with() -> None:
    with pytest.raises(ExpressionError, match=r"\$f is '2 \* x': only numbers"):
        evaluated("$f*y", {"f": "2 * x"})


def test_a_field_has_a_largest_length() -> None:
    text = "x*(" + "+".join(["1"] * LONGEST_FIELD) + ")"
    with pytest.raises(ExpressionError, match=f"at most {LONGEST_FIELD} characters"):
        Field(text)
