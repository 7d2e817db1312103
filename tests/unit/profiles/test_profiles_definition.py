"""The command grammar of a profile: what is read, and that nothing in it can become a raw pipe."""

from pathlib import Path
from types import MappingProxyType

import pytest

from octoform.diagnostics import Diagnostic
from octoform.profiles import Profile, briefing, contributions, devices_of, for_task, load, load_text, match_rule
from octoform.profiles.definition_forms import Value
from octoform.profiles.lines import Command, Line, LineDefinition
from octoform.profiles.model import plain

SHIPPED = Path(__file__).parents[3] / "profiles"
PAGES = Path(__file__).parents[3] / "octoform" / "diagnostics" / "pages"
LAMP = """---
name: bench-lamp
about: the lamp over the bench
product: Bench Lamp Two
evidence: {all: [{vid_pid: "16c0:05df"}, {text: [Bench Lamp]}]}
limits:
  - {tool: lamp_dim, parameter: percent, maximum: 80, unit: "%"}
grammar:
  line: {class: tty, baud: 9600, ok: "OK", error: "E {message}", timeout: 2s, settle: 1s}
  commands:
    - tool: lamp_dim
      send: "DIM {percent} {fade}"
      about: dim the lamp
      effect: actuate
      parameters:
        percent: {type: integer, minimum: 0, maximum: 100, unit: "%"}
        fade: {type: string, enum: [slow, fast]}
    - tool: lamp_temperature
      send: "T?"
      about: temperature of the lamp
      effect: read
      reply: "T {celsius}"
      fields: {celsius: {type: number, unit: C}}
rig:
  facts: [The left bulb is broken.]
  limits:
    - {tool: lamp_dim, parameter: percent, maximum: 40, unit: "%"}
---

It must not get hot.
"""


def lamp(old: str = "", new: str = "") -> tuple[Profile | None, list[Diagnostic]]:
    assert old in LAMP
    return load_text(LAMP.replace(old, new, 1) if old else LAMP, "octopus.yaml")


def good() -> Profile:
    profile, found = lamp()
    assert profile is not None and found == []
    return profile


def test_a_grammar_is_read_as_data() -> None:
    percent = Value("percent", "integer", unit="%", minimum=0, maximum=100)
    fade = Value("fade", "string", choices=("slow", "fast"))
    assert good().grammar == LineDefinition(
        Line("tty", 9600, "\n", "OK", "E {message}", 2.0, 1.0),
        (
            Command("lamp_dim", "DIM {percent} {fade}", "dim the lamp", "actuate", (percent, fade)),
            Command(
                "lamp_temperature",
                "T?",
                "temperature of the lamp",
                "read",
                (),
                ("T {celsius}",),
                (Value("celsius", "number", unit="C"),),
            ),
        ),
    )


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("  line: {", "  lines: {", "'lines' is no field here"),
        ("class: tty", "class: hidraw", "class of the line is not tty"),
        ("baud: 9600, ", "", "baud"),
        ("baud: 9600", "baud: true", "baud"),
        ("baud: 9600", 'baud: 9600, ending: ";"', "ending"),
        ('ok: "OK"', 'ok: "OK {steps}"', "`ok` has a placeholder"),
        ('ok: "OK"', 'ok: ""', "'ok' is not a string"),
        ("E {message}", "E {code}", "another placeholder"),
        ("timeout: 2s", "timeout: 2h", "'timeout' is no duration from 1s to 60s"),
        ("settle: 1s", "settle: 60s", "'settle'"),
        ("tool: lamp_dim\n", "tool: Lamp-Dim\n", "no usable tool name"),
        ("tool: lamp_dim\n", "tool: dim\n", "no usable tool name"),
        ("tool: lamp_temperature", "tool: lamp_dim", "occurs twice"),
        ("tool: lamp_temperature", "tool: send_command", "raw pipe"),
        ("tool: lamp_temperature", "tool: lamp_raw", "raw pipe"),
        ("tool: lamp_temperature", "tool: run_gcode", "raw pipe"),
        ("type: string, enum: [slow, fast]", "type: string", "takes any string"),
        ("enum: [slow, fast]", 'enum: ["slow\\nDIM 100"]', "different short words"),
        ("enum: [slow, fast]", "enum: [slow, slow]", "different short words"),
        ("enum: [slow, fast]", "enum: []", "different short words"),
        ("minimum: 0, maximum: 100", "minimum: 0", "not bounded on both sides"),
        ("minimum: 0, maximum: 100, ", "", "not bounded on both sides"),
        ("minimum: 0, maximum: 100", "minimum: 0.5, maximum: 100", "is no integer"),
        ("minimum: 0, maximum: 100", "minimum: 0, maximum: .inf", "is no integer"),
        ("minimum: 0, maximum: 100", "minimum: 101, maximum: 100", "above its maximum"),
        ('send: "DIM {percent} {fade}"', r'send: "DIM {percent}\n{fade}"', "printable ASCII"),
        ('send: "DIM {percent} {fade}"', r'send: "DIM {percent} {fade}\e"', "printable ASCII"),
        ('send: "DIM {percent} {fade}"', 'send: "DIM {percent} {fadd}"', "{fadd} is not among the parameters"),
        ('send: "DIM {percent} {fade}"', 'send: "DIM {percent}"', "'fade' is declared and not used"),
        ('send: "DIM {percent} {fade}"', 'send: "DIM {percent!r} {fade}"', "no placeholder"),
        ('send: "DIM {percent} {fade}"', 'send: "DIM {percent:99} {fade}"', "no placeholder"),
        ("percent: {type: integer", "device: {type: integer", "no usable name"),
        ("percent: {type: integer", "lambda: {type: integer", "no usable name"),
        ("effect: actuate", "effect: move", "the command has no effect"),
        ("      about: dim the lamp\n", "", "'about' is missing"),
        ('reply: "T {celsius}"', 'reply: "T {kelvin}"', "{kelvin} is not among the fields"),
        ('      reply: "T {celsius}"\n', "", "fields without a `reply`"),
        ("{type: number, unit: C}", "{type: number, maximum: 90}", "has bounds"),
        ("{type: number, unit: C}", "{type: float}", "has no type"),
        ("{type: number, unit: C}", "{type: boolean, words: [T]}", "no two different words of a boolean"),
        ("{type: number, unit: C}", "{type: boolean, words: [T, T]}", "no two different words of a boolean"),
        ("{type: number, unit: C}", "{type: boolean, words: [F, 'T\"']}", "no two different words of a boolean"),
        ("{type: number, unit: C}", "{type: number, words: [F, T]}", "no two different words of a boolean"),
        ('reply: "T {celsius}"', "reply: []", "no list of 1 to 12 lines"),
        ('reply: "T {celsius}"', 'reply: ["T {celsius}", "{celsius}"]', "cannot be separated"),
        ('reply: "T {celsius}"', 'reply: ["T {celsius}", 7]', "'reply' is not a string"),
        ('      send: "DIM {percent} {fade}"\n', "", "sends nothing, and does not only listen"),
        ("about: dim the lamp", "about: dim the lamp\n      shell: reboot", "'shell' is no field here"),
    ],
)
def test_what_is_refused(old: str, new: str, says: str) -> None:
    profile, found = lamp(old, new)
    assert profile is None
    lines = [f"{item.summary} {item.hint}" for item in found if item.code == "PROFILE-GRAMMAR"]
    assert any(says in text for text in lines), [item.summary for item in found]
    assert all(item.span is not None and item.span.line > 8 for item in found if item.code == "PROFILE-GRAMMAR")


def test_a_product_may_acknowledge_nothing_say_several_lines_and_speak_by_itself() -> None:
    profile, found = lamp('ok: "OK", ', "")
    assert profile is not None and found == [] and isinstance(profile.grammar, LineDefinition)
    assert profile.grammar.line.ok is None and "ok" not in plain(profile.grammar)["line"]
    old = LAMP[LAMP.index('      send: "T?"') : LAMP.index("rig:")]
    new = """      about: what it says every second
      effect: read
      reply: ["T {celsius}", "ON {on}"]
      fields: {celsius: {type: number, unit: C}, on: {type: boolean, words: ["NO", "YES"]}}
"""
    profile, found = lamp(old, new)
    assert profile is not None and found == [] and isinstance(profile.grammar, LineDefinition)
    command = plain(profile.grammar)["commands"][1]
    assert "send" not in command and command["reply"] == ["T {celsius}", "ON {on}"]
    assert command["fields"]["on"] == {"type": "boolean", "words": ["NO", "YES"]}


def test_what_nobody_acknowledges_is_neither_counted_nor_ends_a_stop() -> None:
    stop = "  stop: {tool: lamp_stop, about: stop it, until: lamp_dim}\n  commands:\n"
    assert lamp("  commands:\n", stop)[0] is not None
    text = LAMP.replace("  commands:\n", stop).replace('ok: "OK", ', "")
    profile, found = load_text(text, "octopus.yaml")
    assert profile is None
    (problem,) = found
    assert "'lamp_dim' is no command of this protocol definition that is acknowledged" in problem.summary


def test_a_problem_names_its_line_and_column() -> None:
    _, found = lamp("{percent} {fade}", "{percent} {fadd}")
    placed = {item.summary: item.span for item in found}
    span = placed["the placeholder {fadd} is not among the parameters"]
    assert span is not None and (span.line, span.column) == (12, 13)


@pytest.mark.parametrize(
    "value", ["1", "[]", "{line: 1, commands: 2}", "{commands: [1]}", "{line: {}, commands: [{}]}"]
)
def test_nonsense_is_told_and_never_raises(value: str) -> None:
    start, end = LAMP.index("grammar:"), LAMP.index("rig:")
    profile, found = load_text(f"{LAMP[:start]}grammar: {value}\n{LAMP[end:]}", "x")
    assert profile is None and "PROFILE-GRAMMAR" in {item.code for item in found}


def test_limits_name_tools_of_the_grammar() -> None:
    _, found = lamp("tool: lamp_dim, parameter", "tool: lamp_dimm, parameter")
    assert [(item.code, item.summary) for item in found] == [
        ("PROFILE-LIMIT", "the protocol definition has no tool 'lamp_dimm'")
    ]
    _, found = lamp('maximum: 80, unit: "%"', "cumulative: 80, zero: lamp_of")
    assert [(item.code, item.summary) for item in found] == [
        ("PROFILE-LIMIT", "the protocol definition has no tool 'lamp_of'")
    ]
    assert lamp("tool: lamp_dim, parameter", 'tool: "lamp_*", parameter')[1] == []


def test_two_profiles_never_share_a_tool(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.md").write_text(LAMP.replace("name: bench-lamp", f"name: {name}"))
    profiles, found = load([tmp_path / "one.md", tmp_path / "two.md"])
    assert [profile.name for profile in profiles] == ["one"]
    assert [item.code for item in found] == ["PROFILE-GRAMMAR"]


def test_text_and_file_are_the_same_profile(tmp_path: Path) -> None:
    path = tmp_path / "lamp.md"
    path.write_bytes(LAMP.replace("\n", "\r\n").encode())
    (of_file,), _ = load([path])
    assert (of_file.digest, briefing(of_file, {"usb-x"})) == (good().digest, briefing(good(), {"usb-x"}))
    assert for_task(of_file, {"usb-x"}) == for_task(good(), {"usb-x"})


def test_product_and_rig_have_different_scopes() -> None:
    profile = good()
    assert [limit.get("maximum") for limit in profile.limits] == [80, None, 40]
    assert profile.rig.facts == ("The left bulb is broken.",)
    product, _, rig = briefing(profile, {"usb-x"}).partition("Only this rig, no other copy of the product:")
    assert "at most 80" in product and "It must not get hot." in product and "bulb" not in product
    assert "The left bulb is broken." in rig and "at most 40" in rig and "hot" not in rig
    plain, _ = lamp(LAMP[LAMP.index("rig:") : LAMP.index("---\n\nIt")], "")
    assert plain is not None and "This rig alone" not in briefing(plain, {"usb-x"})


@pytest.mark.parametrize(
    ("new", "code"),
    [
        ("rig: 1", "PROFILE-RIG"),
        ("rig: {facts: one}", "PROFILE-RIG"),
        ('rig: {facts: ["two\\nlines"]}', "PROFILE-RIG"),
        ("rig: {fact: [x]}", "PROFILE-FIELD"),
        ("rig: {limits: [{maximum: 3}]}", "PROFILE-LIMIT"),
    ],
)
def test_what_a_rig_may_not_say(new: str, code: str) -> None:
    profile, found = lamp(LAMP[LAMP.index("rig:") : LAMP.index("---\n\nIt")], f"{new}\n")
    assert profile is None and [item.code for item in found] == [code]
    assert (PAGES / f"{code}.md").exists()


def test_the_task_of_an_agent_carries_the_grammar_as_json() -> None:
    found = for_task(good(), {"usb-b", "usb-a"})
    assert (found["name"], found["product"], found["holds"]) == ("bench-lamp", "Bench Lamp Two", ["usb-a", "usb-b"])
    assert found["grammar"]["line"]["timeout"] == 2.0
    assert found["grammar"]["commands"][1] == {
        "tool": "lamp_temperature",
        "send": "T?",
        "about": "temperature of the lamp",
        "effect": "read",
        "parameters": {},
        "reply": "T {celsius}",
        "fields": {"celsius": {"type": "number", "unit": "C"}},
    }


def shipped() -> dict[str, Profile]:
    profiles, found = load(sorted(SHIPPED.glob("*.md")))
    assert found == []
    return {profile.name: profile for profile in profiles}


def test_the_shipped_profiles_say_nothing_of_one_rig() -> None:
    profiles = shipped()
    assert sorted(profiles) == ["camera-rail", "so-arm101"]
    for profile in profiles.values():
        assert profile.rig.facts == () and profile.rig.limits == () and profile.product
    grammar = profiles["camera-rail"].grammar
    assert isinstance(grammar, LineDefinition) and profiles["camera-rail"].stop == ()
    assert [(item.tool, item.send) for item in grammar.commands] == [
        ("rail_move_x", "MOVE_X {steps}"),
        ("rail_move_y", "MOVE_Y {steps}"),
        ("rail_home", "HOME"),
    ]


def board(vid: str, pid: str, text: str = "") -> dict[str, object]:
    return {"id": f"usb-{vid}-{pid}", "name": "board", "vid": vid, "pid": pid, "raw_descriptor": f"x: y\n{text}"}


@pytest.mark.parametrize("word", ["Feetech", "sts3215", "LeRobot", "SO-ARM100", "so-arm101"])
@pytest.mark.parametrize("chip", [("1a86", "7523"), ("1a86", "55d3")])
def test_a_name_is_enough_for_the_arm_and_for_nothing_else(chip: tuple[str, str], word: str) -> None:
    """The truth table of the rule on the way of a person's answer: chip and word, chip, word, neither."""
    arm, sentence = shipped()["so-arm101"], f"That is the {word}, on the left."
    device, other = board(*chip), board("0403", "6001")
    name, stranger = str(device["id"]), str(other["id"])
    probe = {"devices": [device, other]}
    assert devices_of(arm, probe, {name: sentence}) == {name}
    assert devices_of(arm, probe) == frozenset()
    assert devices_of(arm, probe, {stranger: sentence}) == frozenset()
    assert devices_of(arm, {"devices": [other]}, {name: sentence}) == frozenset()
    assert devices_of(arm, {"devices": [device | {"context": True}]}, {name: sentence}) == frozenset()
    assert devices_of(arm, {"devices": [board(*chip, f"label: {word}")]}) == {name}


def test_a_version_in_an_answer_is_one_word() -> None:
    rule, _ = match_rule.read({"text": ["Lamp v1.5"]}, ())
    assert rule is not None and match_rule.holds(rule, {}, "my Lamp v1.5.")


@pytest.mark.parametrize(
    ("sentence", "arm"),
    [
        ("not the SO-ARM101", False),
        ("It isn't a LeRobot arm, it is the pump", False),
        ("the pump, no Feetech servo", False),
        ("a pump instead of the SO-ARM101", False),
        ("not the pump, the SO-ARM101", True),
        ("It isn't the pump but the SO-ARM101.", True),
        ("the SO-ARM101; never mind the camera", True),
    ],
)
def test_what_a_person_denies_is_no_evidence(sentence: str, arm: bool) -> None:
    device = board("1a86", "7523")
    held = devices_of(shipped()["so-arm101"], {"devices": [device]}, {str(device["id"]): sentence})
    assert held == ({device["id"]} if arm else set())


def test_an_answer_is_whole_words_and_for_its_own_device_alone() -> None:
    rail = shipped()["camera-rail"]
    probe = {"devices": [board("2341", "804f"), board("2341", "804f") | {"id": "usb-2341-804f-2"}]}
    answers = MappingProxyType({"usb-2341-804f-2": "the Camera Rail"})
    assert devices_of(rail, probe, answers) == {"usb-2341-804f-2"}
    assert contributions([rail], probe, answers) == [("usb-2341-804f-2", "camera-rail")]
    assert devices_of(rail, probe, {"usb-2341-804f": "a camera railing"}) == frozenset()
