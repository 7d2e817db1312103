"""The words of the manifest's messages, apart from the rules: a text can be improved without reading the logic."""

from octoform.manifest import tree
from octoform.manifest.tree import Items, Loc, Scalar, Table

TYPES = {
    "string_type": "a text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "list_type": "a list",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dict_type": "a mapping",
    "union_tag_not_found": "a name or a mapping",
}
FORMS = {
    "a text": "one word or quoted text",
    "a name": "one word",
    "a whole number": "a number without quotes and point, such as 3",
    "true or false": "`true` or `false`, without quotes",
    "a list": "a list: [first, second]",
    "a mapping": "a mapping: {key: value}",
    "a name or a mapping": "`harness: builtin`, or `harness: {name: command, command: [...]}`",
}
COMMAND_HINT = "write `command: [my-agent, '{task}']`"
VARIABLE_HINT = "list names only, such as MY_API_KEY; values stay in the environment"
MODEL_HINT = "write it as the agent expects it, such as vendor/model-name"
RANGES = {
    "attempts": "allowed: 1 to 20",
    "tools": "allowed: 1 to 200",
    "command": COMMAND_HINT,
    "profiles": "allowed: up to 100 profiles",
    "model": MODEL_HINT,
}
HARNESSES = ("builtin", "command")
LONGEST_WORD = 80
# Words for true and false that YAML 1.2 takes as text, as it takes a quoted true.
SWITCHES = {"yes": "true", "on": "true", "true": "true", "no": "false", "off": "false", "false": "false"}


def dotted(loc: Loc) -> str:
    """A path as a person writes it: ``stages.probe.harness.command[0]``."""
    out = ""
    for part in loc:
        out += f"[{part}]" if isinstance(part, int) else f".{part}" if out else part
    return out


def kind(node: tree.Node | None) -> str:
    """What a value is, in words."""
    if isinstance(node, Table):
        return "a mapping"
    if isinstance(node, Items):
        return "a list"
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, float):
        return "a number with a fraction or exponent"
    return "a number" if isinstance(value, int) else "a text"
