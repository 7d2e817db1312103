"""`dataclass` for records: as that of the standard library, without loading it.

The library of Python 3.11 imports the inspector of sources, and compiles each method by itself, six for a frozen class:
a third of a plan with nothing to do, and a sixth of an apply. Here the other methods are shared, ``__init__`` is made
when the first record of a class is, from code that all classes with as many fields share, and what the library has to
know of a class is made when it asks. Records have neither ``__post_init__`` nor fields that are not given; other
classes and options are the library's. Light: standard library only.
"""

import reprlib
import sys
from operator import attrgetter

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from dataclasses import dataclass as dataclass
    from dataclasses import field as field
    from dataclasses import replace as replace
    from types import CodeType
    from typing import Any
else:

    def dataclass(cls=None, /, **options):
        """See `dataclasses.dataclass`."""
        ours = {"frozen": _record, "frozen slots": _slotted}.get(" ".join(sorted(options)))
        made = ours if ours is not None and all(options.values()) else _library(options)
        return made if cls is None else made(cls)

    def field(**given):
        """See `dataclasses.field`."""
        return _Given(given)

    def replace(record, /, **changes):
        """See `dataclasses.replace`."""
        fields = getattr(type(record), "__record__", None)
        if fields is None:
            import dataclasses

            return dataclasses.replace(record, **changes)
        return type(record)(**{name: getattr(record, name) for name in fields} | changes)


_MISSING = object()
"""No default, and in place of an argument whose default is made again each time."""
_OPTIONS = ("default", "default_factory", "repr", "compare", "hash")
_MORE = "is more than a record: use dataclasses.dataclass"


class _Given:
    """A field as a class declares it."""

    __slots__ = ("compare", "default", "default_factory", "given", "hash", "repr", "type")

    def __init__(self, given: "Mapping[str, Any]") -> None:
        self.given, self.type = given, "Any"
        self.default: Any = given.get("default", _MISSING)
        self.default_factory: Any = given.get("default_factory", _MISSING)
        self.repr: bool = given.get("repr", True)
        self.compare: bool = given.get("compare", True)
        self.hash: bool | None = given.get("hash")

    def is_required(self) -> bool:
        """Whether each record states it."""
        return self.default is _MISSING and self.default_factory is _MISSING


def _library(options: "Mapping[str, Any]") -> "Callable[[type[Any]], type[Any]]":
    """The library's decorator, for a class whose fields are declared with ours."""
    import dataclasses

    def decorated(cls: "type[Any]") -> "type[Any]":
        for name, value in [*vars(cls).items()]:
            if isinstance(value, _Given):
                setattr(cls, name, dataclasses.field(**value.given))
        return dataclasses.dataclass(**options)(cls)

    return decorated


def _slotted(cls: "type[Any]") -> "type[Any]":
    """A class of frozen records with slots."""
    record = _methods(cls)
    fields = record["__record__"]
    own = [name for name in cls.__annotations__ if name in fields]
    inherited = {name for base in cls.__mro__[1:] for name in vars(base).get("__record__", ())}
    record["__slots__"] = tuple(name for name in own if name not in inherited)
    kept = {name: value for name, value in vars(cls).items() if name not in (*own, "__dict__", "__weakref__")}
    metaclass: Any = type(cls)
    made: type[Any] = metaclass(cls.__name__, cls.__bases__, record | _stated(kept))
    made.__qualname__ = cls.__qualname__
    return made


def _record(cls: "type[Any]") -> "type[Any]":
    """A class of frozen records that may keep more than their fields, such as what they have worked out once."""
    stated = _stated(vars(cls))
    for name, value in _methods(cls).items():
        if name not in stated:
            setattr(cls, name, value)
            if isinstance(value, (_Init, _OfLibrary)):
                value.__set_name__(cls, name)
    for name, item in cls.__record__.items():
        if isinstance(vars(cls).get(name), _Given):
            delattr(cls, name)
            if item.default is not _MISSING:
                setattr(cls, name, item.default)
    return cls


def _stated(kept: "Mapping[str, Any]") -> "dict[str, Any]":
    """What a class states itself; Python states by a hash of None only that there is an ``__eq__``."""
    return {name: value for name, value in kept.items() if (name, value) != ("__hash__", None)}


def _methods(cls: "type[Any]") -> "dict[str, Any]":
    """The methods of a class of records, and what else belongs to one."""
    own = {name: _declared(cls, name, kind) for name, kind in cls.__annotations__.items() if not _is_of_class(kind)}
    inherited: dict[str, Any] = {}
    for base in reversed(cls.__mro__[1:]):
        if "__dataclass_fields__" in vars(base) and "__record__" not in vars(base):
            raise TypeError(f"{cls.__name__} {_MORE}")
        inherited |= vars(base).get("__record__", {})
    fields = inherited | own
    if hasattr(cls, "__post_init__"):
        raise TypeError(f"{cls.__name__} {_MORE}")
    required = [name for name in fields if fields[name].is_required()]
    if [*fields][: len(required)] != required:
        raise TypeError(f"{cls.__name__}: a field without a default follows one with a default")
    return {
        "__init__": _Init(),
        "__eq__": _equality(_values([name for name in fields if fields[name].compare])),
        "__hash__": _hash(_values([name for name in fields if _is_hashed(fields[name])])),
        "__repr__": _repr,
        "__setattr__": _refuse_setting,
        "__delattr__": _refuse_deleting,
        "__getstate__": _state,
        "__setstate__": _set_state,
        "__match_args__": tuple(fields),
        "__record__": fields,
        "__dataclass_fields__": _OfLibrary(),
        "__dataclass_params__": _OfLibrary(),
    }


def _declared(cls: "type[Any]", name: str, kind: "Any") -> _Given:
    value: Any = vars(cls).get(name, _MISSING)
    library = sys.modules.get("dataclasses")
    if library is not None and isinstance(value, library.Field):
        value = _of_library(value, library.MISSING)
    given = {} if value is _MISSING else {"default": value}
    found = value if isinstance(value, _Given) else _Given(given)
    found.type = kind
    if {"init", "kw_only"} & found.given.keys() or "InitVar" in str(kind) or "KW_ONLY" in str(kind):
        raise TypeError(f"{cls.__name__} {_MORE}")
    if type(found.default).__hash__ is None:
        raise ValueError(f"mutable default {type(found.default)} for field {name} is not allowed: use default_factory")
    return found


def _of_library(value: "Any", missing: object) -> _Given:
    """A field that was declared with the library's function."""
    given = {name: getattr(value, name) for name in _OPTIONS if getattr(value, name) is not missing}
    if not value.init or value.kw_only is True:
        given["init"] = False
    return _Given(given)


def _is_of_class(kind: object) -> bool:
    return (kind if isinstance(kind, str) else repr(kind)).removeprefix("typing.").startswith("ClassVar")


def _is_hashed(item: _Given) -> bool:
    return bool(item.compare if item.hash is None else item.hash)


class _Init:
    """In place of ``__init__`` until the first record is made."""

    def __set_name__(self, owner: "type[Any]", _: str) -> None:
        self._owner = owner

    def __get__(self, record: "Any", owner: "type[Any]") -> "Any":
        made = _init(self._owner.__record__)
        made.__qualname__ = f"{self._owner.__qualname__}.__init__"
        made.__module__ = self._owner.__module__
        setattr(self._owner, "__init__", made)  # noqa: B010 - the class is of any kind
        return made.__get__(record, owner)


class _OfLibrary:
    """What the library keeps of its classes, made when it asks for it."""

    def __set_name__(self, owner: "type[Any]", name: str) -> None:
        self._owner, self._name = owner, name

    def __get__(self, _: object, __: "type[Any]") -> "Any":
        import dataclasses

        owner = self._owner
        given = {name: dataclasses.field(**item.given) for name, item in owner.__record__.items()}
        kinds = {name: item.type for name, item in owner.__record__.items()}
        twin = type(owner.__name__, (), {**given, "__annotations__": kinds, "__module__": owner.__module__})
        library: Any = dataclasses.dataclass(init=False, repr=False, eq=False)(twin)
        for name in ("__dataclass_fields__", "__dataclass_params__"):
            setattr(owner, name, getattr(library, name))
        return getattr(owner, self._name)


def _init(fields: "Mapping[str, _Given]") -> "Any":
    """``__init__`` of a class with these fields; the code of all classes with as many differs in the names alone."""
    makes = tuple(item.default_factory is not _MISSING for item in fields.values())
    if makes not in _CODES:
        _CODES[makes] = _code(makes)
    names = {f"_{index}": name for index, name in enumerate(fields)}
    code = _CODES[makes]
    code = code.replace(
        co_varnames=tuple(names.get(name, name) for name in code.co_varnames),
        co_consts=tuple(names.get(value, value) if isinstance(value, str) else value for value in code.co_consts),
    )
    known = {f"_make{index}": item.default_factory for index, item in enumerate(fields.values())}
    defaults = tuple(item.default for item in fields.values() if not item.is_required())  # a made one has _MISSING
    function: Any = type(_init)
    return function(code, {**known, "_set": object.__setattr__, "_MISSING": _MISSING}, "__init__", defaults)


_CODES: "dict[tuple[bool, ...], CodeType]" = {}


def _code(makes: "tuple[bool, ...]") -> "CodeType":
    """The code of ``__init__`` for so many fields, ``_0``, ``_1``, ...; those that it ``makes`` have a factory."""
    names = [f"_{index}" for index in range(len(makes))]
    lines = [f"def __init__({', '.join(['self', *names])}):"]
    for index, name in enumerate(names):
        value = f"_make{index}() if {name} is _MISSING else {name}" if makes[index] else name
        lines.append(f" _set(self, {name!r}, {value})")
    found: dict[str, Any] = {}
    exec("\n".join(lines if makes else [*lines, " pass"]), found)
    code: CodeType = found["__init__"].__code__
    return code


def _values(names: "Sequence[str]") -> "Callable[[Any], tuple[Any, ...]]":
    """The function that gives the values of these fields of a record."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda record: tuple(getattr(record, name) for name in names)


def _equality(values: "Callable[[Any], tuple[Any, ...]]") -> "Callable[[Any, Any], Any]":
    def __eq__(self: "Any", other: "Any") -> "Any":
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return __eq__


def _hash(values: "Callable[[Any], tuple[Any, ...]]") -> "Callable[[Any], int]":
    def __hash__(self: "Any") -> int:
        return hash(values(self))

    return __hash__


@reprlib.recursive_repr()
def _repr(self: "Any") -> str:
    shown = (f"{name}={getattr(self, name)!r}" for name, item in self.__record__.items() if item.repr)
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _refuse_setting(_: "Any", name: str, __: "Any") -> None:
    from dataclasses import FrozenInstanceError

    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_deleting(_: "Any", name: str) -> None:
    from dataclasses import FrozenInstanceError

    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _state(self: "Any") -> "list[Any]":
    return [getattr(self, name) for name in self.__record__]


def _set_state(self: "Any", state: "list[Any]") -> None:
    for name, value in zip(self.__record__, state, strict=True):
        object.__setattr__(self, name, value)
