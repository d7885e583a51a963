"""A plugin of mypy: no builtin `sum` of floats, since it adds in another way from Python 3.12 on.

An agent that was recorded by one version of Python has to put out the same bytes in another
(docs/traffic.md).
"""

from collections.abc import Callable

from mypy.plugin import FunctionContext, Plugin
from mypy.types import Instance, TupleType, Type, UnionType, get_proper_type

WORDS = (
    "sum() of floats gives other last digits since Python 3.12; write math.fsum, or additions one"
    " by one where agents have recorded the result"
)


class FloatSums(Plugin):
    """Looks at each call of `sum`."""

    def get_function_hook(self, fullname: str) -> Callable[[FunctionContext], Type] | None:
        return _checked if fullname == "builtins.sum" else None


def _checked(call: FunctionContext) -> Type:
    given = (one for argument in call.args for one in argument)
    if any(_has_float(call.api.get_expression_type(one)) for one in given):
        call.api.fail(WORDS, call.context)  # mypy adds that no overload fits
    return call.default_return_type


def _has_float(given: Type) -> bool:
    """Whether it is a float, or a collection of some."""
    given = get_proper_type(given)
    if isinstance(given, UnionType | TupleType):
        return any(map(_has_float, given.items))
    return isinstance(given, Instance) and (
        given.type.fullname == "builtins.float" or any(map(_has_float, given.args))
    )


def plugin(version: str) -> type[Plugin]:
    """What mypy looks for."""
    return FloatSums
