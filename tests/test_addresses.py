"""Arrays that compiled code hands on as their addresses alone: the same entries."""

import numpy as np
import pytest

numba = pytest.importorskip("numba")

from cradle.runtime.addresses import bare  # noqa: E402

PAIR = np.dtype([("one", "f8"), ("other", "i8")])


@numba.njit
def write_row(row, i, value):
    bare(row)[i] = value
    return bare(row)[i]


@numba.njit
def write_table(table, i, j, value):
    rows = bare(table)
    path = rows[i]
    path[j] = value


@numba.njit
def write_record(records, i, value):
    record = bare(records)[i]
    record.one = value
    record.other += 1
    return record.one


@numba.njit
def write_table_of_records(records, i, j, value):
    bare(records)[i][j].one = value


@pytest.mark.parametrize("kind", ["f8", "i8"])
def test_a_row_of_numbers(kind):
    row = np.arange(5).astype(kind)
    assert write_row(row, 3, 9) == 9
    assert row.tolist() == [0, 1, 2, 9, 4]


def test_a_number_is_stored_as_the_kind_of_its_row():
    row = np.zeros(2)
    write_row(row, 1, 2**53)
    assert row.tolist() == [0.0, 2.0**53]


@pytest.mark.parametrize("shape", [(3, 4), (4, 1), (1, 6)])
def test_a_table_of_numbers(shape):
    table = np.zeros(shape)
    expected = table.copy()
    for at in np.ndindex(shape):
        write_table(table, *at, sum(at) + 1.0)
        expected[at] = sum(at) + 1.0
    assert np.array_equal(table, expected)


def test_a_part_of_a_larger_array_begins_where_it_begins():
    whole = np.zeros((4, 3))
    write_table(whole[1:], 1, 2, 5.0)
    assert np.argwhere(whole).tolist() == [[2, 2]]


def test_records():
    records = np.zeros(4, PAIR)
    assert write_record(records, 2, 0.5) == 0.5
    assert records.tolist() == [(0.0, 0), (0.0, 0), (0.5, 1), (0.0, 0)]


def test_a_table_of_records():
    records = np.zeros((2, 3), PAIR)
    write_table_of_records(records, 1, 2, 0.25)
    assert np.argwhere(records["one"]).tolist() == [[1, 2]]


@pytest.mark.parametrize("array", [np.zeros(6)[::2], np.zeros((2, 3, 4)), np.zeros((3, 4)).T])
def test_others_are_refused(array):
    with pytest.raises(numba.TypingError, match="bare"):
        write_row(array, 0, 1.0)


def test_a_row_of_an_unknown_length_has_none():
    @numba.njit
    def length(row):
        return len(bare(row))

    with pytest.raises(numba.TypingError, match="len"):
        length(np.zeros(3))
