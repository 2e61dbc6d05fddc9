"""Numbers as the pages of the book write them."""

import pytest
from page import aligned, below, count, people, said


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2_234_567, "2.2 million"),
        (36_877, "36\N{NARROW NO-BREAK SPACE}877"),
        (5_235, "5235"),
        (3e150, "3·10¹⁵⁰"),
        (1e-7, "10⁻⁷"),
        (3.2e-8, "3.2·10⁻⁸"),
        (0.0314, "0.031"),
        (-5, "−5"),
        (-3.2e-8, "−3.2·10⁻⁸"),
        (1234.5, "1200"),
        (274_650.5, "270\N{NARROW NO-BREAK SPACE}000"),
        (100.0, "100"),
        (0, "0"),
    ],
)
def test_numbers_for_people(value, text):
    assert people(value) == text


def test_counts_and_small_whole_numbers_are_words():
    assert [count(n, "chain") for n in (0, 1, 12, 35)] == [
        "no chains", "one chain", "twelve chains", "35 chains"
    ]  # fmt: skip
    assert count(2, "ball", "pairs of balls") == "two pairs of balls"
    assert [said(n) for n in (0, 12, 13, 2.0, 0.5)] == ["no", "twelve", "13", "2", "0.5"]
    assert (below(1e-15), below(2e-4)) == ("< 10⁻¹²", "2·10⁻⁴")


def test_a_row_of_velocities():
    assert aligned([-1 / 3, 2 / 3, -1e-9]) == " -0.333  0.667  0.000"
    assert aligned([1], digits=1) == "  1.0"
