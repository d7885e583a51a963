"""A plain content of any class of a language, made from the types of its fields: what tests say
when any will do.
"""

from typing import Any

import msgspec
from msgspec import inspect

from fipa_codec.languages import Languages

_PLAIN: tuple[tuple[type[inspect.Type], Any], ...] = (
    (inspect.NoneType, None),
    (inspect.BoolType, False),
    (inspect.IntType, 0),
    (inspect.FloatType, 0.0),
    (inspect.StrType, "x"),
    (inspect.BytesType, b""),
    (inspect.AnyType, None),
    (inspect.DictType, {}),
    (inspect.SetType, set()),
    (inspect.FrozenSetType, frozenset()),
    (inspect.ListType, []),
    (inspect.VarTupleType, ()),
)


class NoSample(TypeError):
    """No content of `kind` can be made; say one of your own in the test instead."""

    def __init__(self, kind: object, why: str) -> None:
        self.kind, self.why = kind, why
        super().__init__(f"no sample of {kind}: {why}; make one by hand")


def sample(kind: type) -> Any:
    """An instance of a Struct class: defaults where there are some, else the plainest value of each
    field's type.

    Raises NoSample where a type has no plain value, or the class's own checks refuse it.
    """
    try:
        return msgspec.convert(_value(inspect.type_info(kind)), kind)
    except msgspec.ValidationError as error:
        raise NoSample(kind.__name__, str(error)) from error


def sample_named(languages: Languages, name: str) -> Any:
    """A sample of the class written LANGUAGE.Class in a design; None for "". Raises NoSample."""
    if not name:
        return None
    language, _, word = name.partition(".")
    return sample({kind.__name__: kind for kind in languages.named(language).classes}[word])


def _value(info: inspect.Type) -> Any:
    match info:
        case inspect.StructType(array_like=True, fields=fields, tag=tag):
            values = [_value(field.type) for field in fields if field.required]
            return values if tag is None else [tag, *values]
        case inspect.StructType(fields=fields, tag_field=tag_field, tag=tag):
            wanted = {field.encode_name: _value(field.type) for field in fields if field.required}
            return wanted if tag is None else {tag_field: tag, **wanted}
        case inspect.EnumType(cls=members):
            return next(iter(members)).value
        case inspect.LiteralType(values=values):
            return values[0]
        case inspect.TupleType(item_types=parts):
            return tuple(map(_value, parts))
        case inspect.Metadata(type=inner):
            return _value(inner)
        case inspect.UnionType(types=types):
            return (
                None
                if any(isinstance(one, inspect.NoneType) for one in types)
                else _value(types[0])
            )
    for plain, value in _PLAIN:
        if isinstance(info, plain):
            return _within(info, value)
    raise NoSample(type(info).__name__, "it has no plain value")


def _within(info: inspect.Type, value: Any) -> Any:
    """The value, moved to the lower bound of a number that has one."""
    least = getattr(info, "ge", None)
    if least is None and (over := getattr(info, "gt", None)) is not None:
        least = over + 1
    return value if least is None or value >= least else type(value)(least)
