"""Arrays as their addresses alone, for compiled code.

To numba an array is seven numbers or more, and each call hands on all of them: a function of four
arrays takes thirty arguments.  The event loop calls a few such functions in each round, and how
fast it was depended on how the compiler happened to pack these numbers.  An address is one number.
Nothing is lost: compiled code asks no array for more, and as little whether an index lies within it
(`tests/test_work_area.py` asks, in the plain loop).
"""

import operator

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable


class Row(types.Type):
    """The address of numbers, or records, one after the other."""

    def __init__(self, dtype):
        self.dtype = dtype
        super().__init__(f"Row({dtype})")


class Table(types.Type):
    """The address of rows, one after the other, and how long each is."""

    def __init__(self, dtype):
        self.dtype = Row(dtype)
        super().__init__(f"Table({dtype})")


@register_model(Row)
class _RowModel(models.PrimitiveModel):
    def __init__(self, manager, row):
        super().__init__(manager, row, manager.lookup(row.dtype).get_data_type().as_pointer())


@register_model(Table)
class _TableModel(models.StructModel):
    def __init__(self, manager, table):
        super().__init__(manager, table, [("first", table.dtype), ("width", types.intp)])


@type_callable(operator.getitem)
def _type_of_entry(context):
    return lambda group, i: group.dtype if isinstance(group, Row | Table) else None


@type_callable(operator.setitem)
def _type_of_store(context):
    return lambda row, i, value: types.none if isinstance(row, Row) else None


def _entry(builder, row, i):
    return builder.gep(row, [i], inbounds=True)


@lower_builtin(operator.getitem, Row, types.Integer)
def _get_entry(context, builder, signature, given):
    entry = _entry(builder, *given)
    # To numba a record is its address.
    return entry if isinstance(signature.return_type, types.Record) else builder.load(entry)


@lower_builtin(operator.getitem, Table, types.Integer)
def _get_row(context, builder, signature, given):
    table = cgutils.create_struct_proxy(signature.args[0])(context, builder, given[0])
    return _entry(builder, table.first, builder.mul(given[1], table.width))


@lower_builtin(operator.setitem, Row, types.Integer, types.Any)
def _set_entry(context, builder, signature, given):
    row, i, value = given
    value = context.cast(builder, value, signature.args[2], signature.args[0].dtype)
    builder.store(value, _entry(builder, row, i))


@intrinsic
def bare(typing_context, array):
    """Return the address of a contiguous array of one or two dimensions."""
    if not (isinstance(array, types.Array) and array.layout == "C" and array.ndim in (1, 2)):
        return None
    kind = Row if array.ndim == 1 else Table

    def code(context, builder, signature, given):
        parts = cgutils.create_struct_proxy(signature.args[0])(context, builder, given[0])
        bare_type = signature.return_type
        row = bare_type if kind is Row else bare_type.dtype
        first = builder.bitcast(parts.data, context.get_value_type(row))
        if kind is Row:
            return first
        table = cgutils.create_struct_proxy(bare_type)(context, builder)
        table.first = first
        table.width = builder.extract_value(parts.shape, 1)
        return table._getvalue()

    return kind(array.dtype)(array), code
