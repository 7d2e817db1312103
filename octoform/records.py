"""`dataclass` for records: as that of the standard library, but only one method of a class is compiled.

The library of Python 3.11 compiles each method by itself, six for a frozen class (that of 3.13 compiles them at once).
With some sixty such classes that was a quarter of a plan with nothing to do, and with three hundred a sixth of an
apply. Records have neither ``__post_init__`` nor fields that are not given; other classes and options are the
library's. Light: standard library only.
"""

import dataclasses
import reprlib
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, **options):
        """See `dataclasses.dataclass`."""
        made = _record if options == {"frozen": True, "slots": True} else dataclasses.dataclass(**options)
        return made if cls is None else made(cls)


_UNGIVEN = object()
"""In place of an argument whose default is made again each time."""


def _record(cls: type[Any]) -> type[Any]:
    """A class of frozen records with slots."""
    made: type[Any] = dataclasses.dataclass(init=False, repr=False, eq=False, slots=True)(cls)
    fields = dataclasses.fields(made)
    if hasattr(made, "__post_init__") or any(not field.init or field.kw_only for field in fields):
        raise TypeError(f"{cls.__name__} is more than a record: use dataclasses.dataclass")
    methods: dict[str, Any] = {}
    exec(_source(fields), _names(fields), methods)  # its words are names of fields, as in the library's
    methods["__eq__"] = _equality(_values([field.name for field in fields if field.compare]))
    hashed = [field.name for field in fields if (field.compare if field.hash is None else field.hash)]
    methods["__hash__"] = _hash(_values(hashed))
    shared = {
        "__repr__": _repr,
        "__setattr__": _refuse_setting,
        "__delattr__": _refuse_deleting,
        "__getstate__": _state,
        "__setstate__": _set_state,
    }
    for name, method in (methods | shared).items():
        if name not in cls.__dict__:
            if name in methods:
                method.__qualname__ = f"{cls.__qualname__}.{name}"
            setattr(made, name, method)
    return made


def _source(fields: tuple[dataclasses.Field[Any], ...]) -> str:
    """``__init__`` as text."""
    given = "".join(f", {field.name}{'' if _is_required(field) else f'=_default_{field.name}'}" for field in fields)
    lines = [f"def __init__(self{given}):"]
    for field in fields:
        value = field.name
        if field.default_factory is not dataclasses.MISSING:
            value = f"_make_{value}() if {value} is _UNGIVEN else {value}"
        lines.append(f" _set(self, {field.name!r}, {value})")
    return "\n".join(lines if fields else [*lines, " pass"])


def _names(fields: tuple[dataclasses.Field[Any], ...]) -> dict[str, Any]:
    """The names that the source text of `_source` refers to."""
    found: dict[str, Any] = {"_set": object.__setattr__, "_UNGIVEN": _UNGIVEN}
    for field in fields:
        if field.default_factory is not dataclasses.MISSING:
            found |= {f"_make_{field.name}": field.default_factory, f"_default_{field.name}": _UNGIVEN}
        elif field.default is not dataclasses.MISSING:
            found[f"_default_{field.name}"] = field.default
    return found


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


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
