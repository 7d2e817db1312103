"""A tool with another name for the same devices and effect is a rename; everything else comes or goes."""

from octoform.plan.diff import Tool, changes
from octoform.plan.model import Action, Change


def tool(name: str, *devices: str, effect: str = "read") -> Tool:
    return Tool(name, frozenset(devices or ("camera",)), effect)


def told(before: list[Tool], after: list[Tool]) -> list[tuple[str, Action, str]]:
    found = changes(before, after)
    assert {change.kind for change in found} <= {"tool"}
    return [(change.name, change.action, change.text) for change in found]


def test_equal_tools_are_no_change() -> None:
    assert changes([tool("a"), tool("b")], [tool("b"), tool("a")]) == ()


def test_a_new_name_for_the_same_devices_and_effect_is_a_rename() -> None:
    found = changes([tool("capture_image"), tool("kept", "x")], [tool("take_picture"), tool("kept", "x")])
    assert found == (Change("tool", "take_picture", Action.UPDATE, "renamed from capture_image"),)


def test_another_device_or_effect_is_another_tool() -> None:
    assert told([tool("a", "one")], [tool("b", "two")]) == [("b", Action.CREATE, ""), ("a", Action.DESTROY, "")]
    assert told([tool("a")], [tool("b", effect="actuate")]) == [("b", Action.CREATE, ""), ("a", Action.DESTROY, "")]


def test_where_two_could_be_the_one_nothing_is_guessed() -> None:
    both = [("c", Action.CREATE, ""), ("a", Action.DESTROY, ""), ("b", Action.DESTROY, "")]
    assert told([tool("a"), tool("b")], [tool("c")]) == both
    two = [("c", Action.CREATE, ""), ("d", Action.CREATE, ""), ("a", Action.DESTROY, "")]
    assert told([tool("a")], [tool("c"), tool("d")]) == two
