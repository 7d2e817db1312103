"""`dataclass` for records: as that of the standard library, but no method of a class is compiled for it alone.

The library of Python 3.11 compiles each method by itself, six for a frozen class (that of 3.13 compiles them at once),
and makes each class with slots twice over. With some sixty such classes that was a quarter of a plan with nothing to
do, and with three hundred a sixth of an apply. Here all classes with as many fields share the code of ``__init__``, in
which only the names differ. Records have neither ``__post_init__`` nor fields that are not given; other classes and
options are the library's. Light: standard library only.
"""

import dataclasses
import inspect
import reprlib
from collections.abc import Callable, Sequence
from functools import cache
from operator import attrgetter
from types import CodeType, FunctionType, MemberDescriptorType
from typing import TYPE_CHECKING, Any, ClassVar, get_origin

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, **options):
        """See `dataclasses.dataclass`."""
        made = _record if options == {"frozen": True, "slots": True} else dataclasses.dataclass(**options)
        return made if cls is None else made(cls)


_UNGIVEN = object()
"""In place of an argument whose default is made again each time."""
_FIELDS, _PARAMETERS = "__dataclass_fields__", "__dataclass_params__"
"""Where the library looks for what `dataclasses.fields`, `replace` and `asdict` go by."""


@dataclasses.dataclass(frozen=True, init=False, repr=False, eq=False)
class _Sample:
    """What the library itself notes of a frozen class and of a field."""

    field: object


_FIELD: Any = dataclasses.fields(_Sample)[0]


def _record(cls: type[Any]) -> type[Any]:
    """A class of frozen records with slots."""
    found = _fields(cls)
    fields = tuple(found.values())
    if hasattr(cls, "__post_init__") or any(not field.init or field.kw_only for field in fields):
        raise TypeError(f"{cls.__name__} is more than a record: use dataclasses.dataclass")
    names = tuple(found)
    hashed = [field.name for field in fields if (field.compare if field.hash is None else field.hash)]
    methods: dict[str, Any] = {
        "__init__": _init(fields),
        "__eq__": _equality(_values([field.name for field in fields if field.compare])),
        "__hash__": _hash(_values(hashed)),
    }
    for name, method in methods.items():
        method.__qualname__ = f"{cls.__qualname__}.{name}"
    inherited = {name for base in cls.__mro__[1:] for name in _slots(base)}
    dropped = {*names, "__dict__", "__weakref__"}
    contents = {
        **_SHARED,
        **methods,
        **{name: value for name, value in cls.__dict__.items() if name not in dropped},
        "__slots__": tuple(name for name in names if name not in inherited),
        "__match_args__": names,
        _FIELDS: found,
        _PARAMETERS: getattr(_Sample, _PARAMETERS),
    }
    kind: Any = type(cls)
    made: type[Any] = kind(cls.__name__, cls.__bases__, contents)
    made.__qualname__ = cls.__qualname__
    return made


def _slots(cls: type[Any]) -> tuple[str, ...]:
    slots = cls.__dict__.get("__slots__", ())
    return (slots,) if isinstance(slots, str) else tuple(slots)


def _fields(cls: type[Any]) -> dict[str, dataclasses.Field[Any]]:
    """The fields of the classes above and of this one, by name."""
    found: dict[str, dataclasses.Field[Any]] = {}
    for base in reversed(cls.__mro__[1:]):
        found |= base.__dict__.get(_FIELDS, {})
    for name, kind in inspect.get_annotations(cls).items():
        if ClassVar in (kind, get_origin(kind)) or (isinstance(kind, str) and "ClassVar" in kind):
            continue
        given: Any = getattr(cls, name, dataclasses.MISSING)
        if isinstance(given, MemberDescriptorType):  # a slot of the class above
            given = dataclasses.MISSING
        field: Any = given if isinstance(given, dataclasses.Field) else dataclasses.field(default=given)
        if field.default.__class__.__hash__ is None:
            raise ValueError(f"mutable default {type(field.default)} for field {name} is not allowed")
        field.name, field.type, field._field_type = name, kind, _FIELD._field_type
        field.kw_only = field.kw_only is True
        found[name] = field
    return found


def _init(fields: Sequence[dataclasses.Field[Any]]) -> FunctionType:
    """``__init__`` of a class with these fields."""
    required = [_is_required(field) for field in fields]
    if required != sorted(required, reverse=True):
        raise TypeError("a field without a default follows one that has a default")
    made = {f"_make{index}": field.default_factory for index, field in enumerate(fields) if _is_made(field)}
    code = _code(tuple(map(_is_made, fields)))
    names = {f"_{index}": field.name for index, field in enumerate(fields)}
    code = code.replace(
        co_varnames=tuple(names.get(name, name) for name in code.co_varnames),
        co_consts=tuple(names.get(value, value) if isinstance(value, str) else value for value in code.co_consts),
    )
    known = {"_set": object.__setattr__, "_UNGIVEN": _UNGIVEN, **made}
    defaults = tuple(_UNGIVEN if _is_made(field) else field.default for field in fields if not _is_required(field))
    return FunctionType(code, known, "__init__", defaults)


@cache
def _code(made: tuple[bool, ...]) -> CodeType:
    """The code of ``__init__`` for so many fields, ``_0``, ``_1``, ...; those that are ``made`` have a factory."""
    names = [f"_{index}" for index in range(len(made))]
    lines = [f"def __init__({', '.join(['self', *names])}):"]
    for index, (name, has_factory) in enumerate(zip(names, made, strict=True)):
        value = f"_make{index}() if {name} is _UNGIVEN else {name}" if has_factory else name
        lines.append(f" _set(self, {name!r}, {value})")
    found: dict[str, FunctionType] = {}
    exec("\n".join(lines if made else [*lines, " pass"]), found)
    return found["__init__"].__code__


def _is_made(field: dataclasses.Field[Any]) -> bool:
    return field.default_factory is not dataclasses.MISSING


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and not _is_made(field)


def _values(names: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    """The function that gives the values of these fields of a record."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda record: tuple(getattr(record, name) for name in names)


def _equality(values: Callable[[Any], tuple[Any, ...]]) -> Callable[[Any, Any], Any]:
    def __eq__(self: Any, other: Any) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return __eq__


def _hash(values: Callable[[Any], tuple[Any, ...]]) -> Callable[[Any], int]:
    def __hash__(self: Any) -> int:
        return hash(values(self))

    return __hash__


@reprlib.recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{field.name}={getattr(self, field.name)!r}" for field in dataclasses.fields(self) if field.repr)
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _refuse_setting(_: Any, name: str, __: Any) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_deleting(_: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _set_state(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)


_SHARED = {
    "__repr__": _repr,
    "__setattr__": _refuse_setting,
    "__delattr__": _refuse_deleting,
    "__getstate__": _state,
    "__setstate__": _set_state,
}
"""The methods that all records have in common."""
