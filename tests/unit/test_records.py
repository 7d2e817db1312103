"""A record is what a frozen dataclass of the standard library is, whichever way its methods were compiled."""

import copy
import dataclasses
import functools
import inspect
import pickle
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import pytest

from octoform.records import dataclass, field, replace

Decorator = Callable[[type[Any]], type[Any]]


LIGHT = """
import sys
from octoform.records import dataclass, field, replace

@dataclass(frozen=True, slots=True)
class Lamp:
    name: str
    parts: list = field(default_factory=list)

assert replace(Lamp("a"), name="b") == Lamp("b") and "name='b'" in repr(Lamp("b"))
print(*{"dataclasses", "inspect", "typing"} & {*sys.modules})
"""


@dataclass(frozen=True, slots=True)
class Kept:
    """At the top of a module, where pickle finds it."""

    name: str
    parts: list[int] = dataclasses.field(default_factory=list)


def made(decorated: Decorator) -> type[Any]:
    """One of each kind of field."""

    @decorated
    class Lamp:
        """A lamp."""

        kind: ClassVar[str] = "light"
        name: str
        level: int = 3
        parts: list[int] = dataclasses.field(default_factory=list, repr=False)
        seen: float = dataclasses.field(default=0.0, compare=False)
        weight: int = dataclasses.field(default=1, hash=False)

        @property
        def half(self) -> float:
            """Half of the level."""
            return self.level / 2

    return Lamp


OURS = made(dataclass(frozen=True, slots=True))
LIBRARY = made(dataclasses.dataclass(frozen=True, slots=True))
GIVEN: list[tuple[tuple[Any, ...], dict[str, Any]]] = [
    (("a",), {}),
    (("a", 3), {}),
    (("a", 4), {"seen": 2.0}),
    (("a", 4), {"seen": 5.0}),
    (("b",), {"parts": (1, 2)}),
    (("b",), {"weight": 7, "parts": ()}),
    ((), {"name": "c", "parts": ()}),
]


def outcome(function: Callable[[], object]) -> str:
    try:
        return repr(function())
    except (TypeError, AttributeError, ValueError) as problem:
        return f"{type(problem).__name__}: {problem}"


def looked(look: Callable[[Any], object], cls: type[Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> object:
    return look(cls(*arguments, **named))


@pytest.mark.parametrize(("arguments", "named"), GIVEN)
def test_it_is_made_shown_and_changed_like_the_librarys(arguments: tuple[Any, ...], named: dict[str, Any]) -> None:
    for look in (
        repr,
        lambda one: one.half,
        lambda one: [getattr(one, item.name) for item in dataclasses.fields(one)],
        dataclasses.asdict,
        lambda one: dataclasses.replace(one, level=9),
        lambda one: dataclasses.replace(one, nothing=9),
        lambda one: setattr(one, "level", 1),
        lambda one: delattr(one, "level"),
        lambda one: one.__dict__,
        copy.copy,
        copy.deepcopy,
        lambda one: hash(one) == hash(copy.copy(one)),
    ):
        ours, library = (outcome(partial(looked, look, cls, arguments, named)) for cls in (OURS, LIBRARY))
        assert ours == library


def test_they_are_equal_and_hashed_where_the_librarys_are() -> None:
    def table(cls: type[Any]) -> list[tuple[bool, bool]]:
        all_of = [cls(*arguments, **{"parts": (), **named}) for arguments, named in GIVEN]
        return [(one == other, hash(one) == hash(other)) for one in all_of for other in all_of]

    assert table(OURS) == table(LIBRARY)
    assert OURS("a") != LIBRARY("a") and OURS("a") != "a" and OURS("a").__eq__("a") is NotImplemented
    assert OURS("a").parts is not OURS("a").parts


def test_its_class_tells_of_itself_what_the_librarys_does() -> None:
    assert OURS.__match_args__ == LIBRARY.__match_args__
    assert OURS.__slots__ == LIBRARY.__slots__
    assert list(inspect.signature(OURS).parameters) == list(inspect.signature(LIBRARY).parameters)
    wrong: tuple[tuple[object, ...], ...] = ((), ("a", 1, [], 0.0, 1, 2))
    for arguments in wrong:
        ours, library = (outcome(partial(looked, repr, cls, arguments, {})) for cls in (OURS, LIBRARY))
        assert ours == library and "TypeError" in ours
    assert OURS.__init__.__qualname__ == LIBRARY.__init__.__qualname__


def test_what_the_class_says_of_itself_stands() -> None:
    @dataclass(frozen=True, slots=True)
    class Own:
        """A record with a text of its own."""

        name: str

        def __repr__(self) -> str:
            return "mine"

    @dataclass(frozen=True, slots=True)
    class Empty:
        """No fields at all."""

    assert repr(Own("a")) == "mine" and Own("a") == Own("a")
    assert Empty() == Empty() and hash(Empty()) == hash(Empty())


def test_one_that_holds_itself_is_shown() -> None:
    one = Kept("a")
    one.parts.append(one)  # type: ignore[arg-type]
    assert repr(one) == "Kept(name='a', parts=[...])"
    assert pickle.loads(pickle.dumps(Kept("b", [1]))) == Kept("b", [1])


def test_a_record_of_a_record_has_the_fields_of_both() -> None:
    def table(decorated: Decorator) -> list[str]:
        @decorated
        class Above:
            name: str
            level: int = 3

        @decorated
        class Below(Above):
            level: int = 4
            kind: "ClassVar[str]" = "light"
            parts: list[int] = dataclasses.field(default_factory=list)

        looks: tuple[Callable[[Any], object], ...] = (
            repr,
            dataclasses.astuple,
            lambda one: dataclasses.replace(one, name="b"),
            lambda one: (type(one).__slots__, type(one).__match_args__, type(one).kind, one == copy.copy(one)),
            lambda one: [(field.name, field.kw_only, field.init) for field in dataclasses.fields(one)],
        )
        given: tuple[tuple[Any, ...], ...] = (("a",), ("a", 5), ("a", 5, [1]), ())
        return [outcome(partial(looked, look, Below, arguments, {})) for look in looks for arguments in given]

    assert table(dataclass(frozen=True, slots=True)) == table(dataclasses.dataclass(frozen=True, slots=True))


@pytest.mark.parametrize("options", [{"frozen": True, "slots": True}, {}])
def test_fields_that_no_class_can_have_are_refused(options: dict[str, bool]) -> None:
    made: Any = dataclass(**options)
    with pytest.raises(TypeError, match="default"):
        made(type("Late", (), {"__annotations__": {"first": int, "second": int}, "first": 1}))
    with pytest.raises(ValueError, match="mutable default"):
        made(type("Shared", (), {"__annotations__": {"parts": list}, "parts": []}))


def test_what_is_more_than_a_record_is_refused_and_other_options_are_the_librarys() -> None:
    with pytest.raises(TypeError, match=r"use dataclasses\.dataclass"):

        @dataclass(frozen=True, slots=True)
        class Later:
            name: str

            def __post_init__(self) -> None: ...

    with pytest.raises(TypeError, match=r"use dataclasses\.dataclass"):

        @dataclass(frozen=True, slots=True)
        class Hidden:
            name: str = dataclasses.field(default="", init=False)

    @dataclass(slots=True)
    class Count:
        number: int = 0

    count = Count()
    count.number += 1
    assert count == Count(1)


def test_none_is_made_with_the_library() -> None:
    done = subprocess.run([sys.executable, "-c", LIGHT], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"


def test_fields_may_be_declared_with_either_function_and_a_record_may_extend_another() -> None:
    @dataclass(frozen=True, slots=True)
    class Lamp:
        name: str
        parts: list[int] = field(default_factory=list, compare=False)

    @dataclass(frozen=True, slots=True)
    class Row(Lamp):
        seen: float = dataclasses.field(default=1.0, repr=False)

    row = Row("a", [1])
    assert (row.name, row.parts, row.seen, repr(row).endswith("Row(name='a', parts=[1])")) == ("a", [1], 1.0, True)
    assert row == Row("a", [2]) and replace(row, seen=2.0) != row and not hasattr(row, "__dict__")
    assert [item.name for item in dataclasses.fields(row)] == ["name", "parts", "seen"]
    assert dataclasses.asdict(row) == {"name": "a", "parts": [1], "seen": 1.0}


def test_without_slots_it_may_keep_what_it_has_worked_out() -> None:
    @dataclass(frozen=True)
    class Place:
        name: str
        parts: tuple[str, ...] = field(default=())

        @functools.cached_property
        def path(self) -> str:
            return "/".join((self.name, *self.parts))

    place = Place("a", ("b",))
    assert place.path == "a/b" and vars(place) == {"name": "a", "parts": ("b",), "path": "a/b"}
    assert Place("a") == Place("a", ()) and hash(Place("a")) == hash(Place("a", ())) and Place.parts == ()
    with pytest.raises(dataclasses.FrozenInstanceError):
        place.name = "b"  # type: ignore[misc]
    assert dataclasses.is_dataclass(Place) and dataclasses.replace(place, name="c").path == "c/b"


def test_a_field_without_a_default_and_a_shared_list_are_refused_as_by_the_library() -> None:
    with pytest.raises(TypeError, match="without a default"):

        @dataclass(frozen=True, slots=True)
        class Late:
            name: str = ""
            size: int  # type: ignore[misc]

    with pytest.raises(ValueError, match="mutable default"):

        @dataclass(frozen=True, slots=True)
        class Shared:
            parts: list[int] = []  # noqa: RUF012
