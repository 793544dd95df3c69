"""The plant's three calls of a sample from code compiled with numba, by their addresses.

Addresses are plain integers, so that compiled loops can be cached.
"""

from collections.abc import Sequence
from typing import Any, Final

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from cosim.fmu import GET, INSTANCE, SET, STEP


def pointer_call(name: str, arguments: Sequence[ir.Type]) -> Any:
    """A compiled call of the C function at an address: int32 f(address, ...), every argument an integer, float64 or
    address."""

    @intrinsic
    def call(typing_context, address, values):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
            function = ir.FunctionType(ir.IntType(32), arguments)
            pointer = builder.inttoptr(args[0], function.as_pointer(), name=name)
            given = cgutils.unpack_tuple(builder, args[1], len(arguments))
            cast = [
                builder.inttoptr(value, kind) if isinstance(kind, ir.PointerType) else value
                for value, kind in zip(given, arguments, strict=True)
            ]
            return builder.call(pointer, cast)

        return types.int32(address, values), generate

    return call


_ADDRESS: Final = ir.IntType(8).as_pointer()
_SIZE: Final = ir.IntType(64)
_REAL: Final = ir.DoubleType()
_BOOL: Final = ir.IntType(1)

_set_float64 = pointer_call("fmi3SetFloat64", (_ADDRESS, _ADDRESS, _SIZE, _ADDRESS, _SIZE))
_get_float64 = pointer_call("fmi3GetFloat64", (_ADDRESS, _ADDRESS, _SIZE, _ADDRESS, _SIZE))
_do_step = pointer_call("fmi3DoStep", (_ADDRESS, _REAL, _REAL, _BOOL, _ADDRESS, _ADDRESS, _ADDRESS, _ADDRESS))


@njit(cache=True)
def exchange(handle, inputs, input_values, outputs, output_values, flags, t, step):  # type: ignore[no-untyped-def]
    """Sets inputs, steps from ``t`` by ``step`` [s], gets outputs; gives the worst FMI status.

    handle int64[4]; inputs, outputs uint32 value references; input_values, output_values f8 [SI]; flags f8[4],
    scratch of the step.
    """
    instance = handle[INSTANCE]
    n_in, n_out = len(input_values), len(output_values)
    status = _set_float64(handle[SET], (instance, inputs.ctypes.data, n_in, input_values.ctypes.data, n_in))
    at = flags.ctypes.data
    status = max(status, _do_step(handle[STEP], (instance, t, step, False, at, at + 8, at + 16, at + 24)))
    return max(
        status, _get_float64(handle[GET], (instance, outputs.ctypes.data, n_out, output_values.ctypes.data, n_out))
    )
