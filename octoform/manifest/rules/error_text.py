"""The words of the manifest's messages, apart from the rules: a text can be improved without reading the logic."""

from octoform.manifest import base_url
from octoform.manifest.source import tree
from octoform.manifest.source.tree import Items, Loc, Scalar, Table

TYPES = {
    "string_type": "a text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "list_type": "a list",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dict_type": "a mapping",
    "float_type": "a number",
    "union_tag_not_found": "a name or a mapping",
}
FORMS = {
    "a text": "one word or quoted text",
    "a name": "one word",
    "a number": "a number without quotes, such as 2.5",
    "auto, true, false or a mapping": "`sandbox: auto`, `sandbox: true`, or `sandbox: {network: false}`",
    "a whole number": "a number without quotes and point, such as 3",
    "true or false": "`true` or `false`, without quotes",
    "a list": "a list: [first, second]",
    "a mapping": "a mapping: {key: value}",
    "a name or a mapping": "`harness: builtin`, or `harness: {name: command, command: [...]}`",
}
RECORDING_HINT = "name the folder of a recording, such as recordings/bench"
COMMAND_HINT = "write `command: [my-agent, '{task}']`"
KEY_HINT = "write the name of a variable in capitals, such as MY_API_KEY; its value stays in the environment"
VARIABLE_HINT = "list names only, such as MY_API_KEY; values stay in the environment"
MODEL_HINT = "write it as the agent expects it, such as vendor/model-name"
RANGES = {
    "attempts": "allowed: 1 to 20",
    "tools": "allowed: 1 to 200",
    "command": COMMAND_HINT,
    "profiles": "allowed: up to 100 profiles",
    "answers": "allowed: up to 200 answers",
    "privileged_steps": "allowed: up to 20 steps",
    "model": MODEL_HINT,
    "key": KEY_HINT,
    "turns": "allowed: 1 to 10000",
    "usd": "write US dollars, such as 2.50",
    **dict.fromkeys(("input", "cached", "output"), "write US dollars for a million tokens, such as 0.5"),
    "max_tokens": "allowed: 64 to 8000",
    "base_url": base_url.HINT,
    "recording": RECORDING_HINT,
    "rules": "allowed: up to 100 rules",
    "rules.tools": "name the tools that it is for, such as [move_rail]; allowed: 1 to 100",
    "limits": "allowed: up to 200 limits",
    "parameter": "name one parameter of the tools, such as percent",
    **dict.fromkeys(("minimum", "maximum"), "write a number, such as -2000 or 0.5"),
    **dict.fromkeys(("step", "cumulative"), "write how far it may go, in both directions, such as 500"),
    "result_bytes": "allowed: 1000 to 1000000000",
    "port": "allowed: 1 to 65535",
    "hosts": "allowed: up to 100 names",
    "origins": "allowed: up to 100 origins",
    "heal_attempts": "allowed: 1 to 20",
    "calls_per_hour": "allowed: 0 to 1000; 0 asks no agent",
    "usd_per_hour": "write US dollars, such as 2.50",
    "webhook": "write https://alerts.example.org/hook, or keep it in a variable: ${ALERT_URL}",
    "metrics": "write a path that ends in .prom, such as /var/lib/node_exporter/octoform.prom",
    "notify.command": "write a list: [./tell-me, --trouble]",
    "tunnel.command": 'write for example [cloudflared, tunnel, --url, "{url}"]',
}
# What people look for at the top, and why it is not there.
NO_KEYS = {"devices": "devices are found, not listed; what cannot be seen of them belongs in a profile"}
LONGEST_WORD = 80
# Words for true and false that YAML 1.2 takes as text, as it takes a quoted true.
SWITCHES = {"yes": "true", "on": "true", "true": "true", "no": "false", "off": "false", "false": "false"}


def range_of(loc: Loc) -> str | None:
    """What a setting allows; by its last two names where the last one alone means several things."""
    names = [part for part in loc if isinstance(part, str)]
    return RANGES.get(".".join(names[-2:]) if len(names) > 1 else "", RANGES.get(str(loc[-1]) if loc else ""))


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
