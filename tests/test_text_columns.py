"""The compiled parser of numbers against Python's float(), bit for bit."""

import numpy as np
import pytest

from lammps_blast.text_columns import compiled_parser, read_text_columns

TINY = ["5e-324", "-4.9e-324", "2.2250738585072011e-308", "2.2250738585072014e-308", "1e-300"]
LARGE = ["1e308", "-1.7976931348623157e+308", "1" * 300, "9007199254740993"]
SPECIAL = ["nan", "-nan", "+nan", "NaN", "inf", "-inf", "+inf", "INF", "infinity", "-Infinity"]
FORMS = ["+1.0", "-0", "-0.0", "1.", ".5", "1E5", "1e+05", "1e-5", "007", "0e999999999"]
# Half way between two doubles, and just above.
TIES = ["1.00000000000000011102230246251565404", "1.000000000000000111022302462515654041"]

BEYOND_DOUBLES = ["1e400", "-1e400", "1e-400", "1.7976931348623159e308"]
NOT_PYTHONS = ["nan(1)", "-nan(x)", "+-1", "++1", "-+1", "1e", "1e+", "0x1p3", "1d5", "1,5", "."]
NOT_PYTHONS += ["+", "-", "in", "infin", "nan)", "1\0", "1.0f", "1.2.3", "\xa01", "A"]


def bits(numbers) -> list[int]:
    return np.asarray(numbers, dtype=float).view(np.uint64).ravel().tolist()


def test_the_parser_is_installed():
    assert compiled_parser() is not None


@pytest.mark.parametrize("form", ["%.17g", "%.15g", "%.13g", "%e", "%.20e", "%g"])
def test_numbers_are_those_of_python(form):
    """Doubles with random bits, denormal ones, and some of everyday size."""
    rng = np.random.default_rng(11)
    anything = rng.integers(0, 2**64, size=(20_000, 2), dtype=np.uint64).view(float)
    anything = anything[np.isfinite(anything).all(axis=1)]
    denormal = rng.integers(1, 2**52, size=(2_000, 2), dtype=np.uint64).view(float)
    everyday = rng.normal(size=(20_000, 2))
    lines = [f"{form % a} {form % b}" for a, b in (*anything, *denormal, *everyday)]
    table = read_text_columns(("\n".join(lines) + "\n").encode(), 0, (len(lines), 2))
    assert table is not None
    assert bits(table) == bits([[float(word) for word in line.split()] for line in lines])


@pytest.mark.parametrize("word", TINY + LARGE + SPECIAL + FORMS + TIES)
@pytest.mark.parametrize("ending", ["\n", " \n", "\r\n", "\t\r\n"])
def test_every_form_of_a_number(word, ending):
    text = f"the header\n \t{word}  1 {word}{ending}{word}\t2 {word}{ending}".encode()
    table = read_text_columns(text, len("the header\n"), (2, 3))
    assert table is not None
    number = float(word)
    assert bits(table) == bits([number, 1, number, number, 2, number])


@pytest.mark.parametrize("word", BEYOND_DOUBLES + NOT_PYTHONS)
def test_what_is_unusual_or_no_number_is_left_to_others(word):
    text = f"1 2\n3 {word}\n".encode("latin-1")
    assert read_text_columns(text, 0, (2, 2)) is None


OTHER_SHAPES = ["1 2\n3 4", "1 2\n3\n", "1 2\n3 4 5\n", "1 2\n", "1 2\n3 4\n5 6\n", ""]
OTHER_SHAPES += ["1 2\n\n3 4\n", "1 2\n3 4\n\n", "1 2\n3 4\n ", "1\n2 3\n4\n"]


@pytest.mark.parametrize("text", OTHER_SHAPES)
def test_another_shape_is_left_to_others(text):
    assert read_text_columns(text.encode(), 0, (2, 2)) is None
