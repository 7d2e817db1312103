"""One server comes into a text and goes out again, and nothing else of the text is touched."""

import json
import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML
from unit.endpoint.client_documents import documents

from octoform.endpoint.mcp_clients import json_edit, merge, toml_text, yaml_text
from octoform.endpoint.mcp_clients.json_edit import Node
from octoform.endpoint.mcp_clients.known_clients import CLIENTS, Client, form
from octoform.endpoint.mcp_clients.merge import Edited, Taken, Wish
from octoform.endpoint.mcp_clients.text_edit import Unreadable, at

NAME = "octoform-bench"
COMMAND = ("/opt/with blank/python", "-I", "-m", "octoform.cli", '-chdir=/home/a"b', "connect", "bench")
URL = "http://10.0.0.2:7777/mcp"


def wish(key: str, url: str | None = None, table: tuple[str, ...] | None = None) -> Wish:
    client = CLIENTS[key]
    entry = form(client, NAME, COMMAND, url)
    assert entry is not None
    return Wish(table or client.table, NAME, entry, prompted=url is not None)


def merged(key: str, text: str, url: str | None = None, table: tuple[str, ...] | None = None) -> str:
    done = merge.merge(CLIENTS[key], text, wish(key, url, table), lambda _: True)
    assert isinstance(done, Edited), done
    assert done.text is not None
    return done.text


def taken_out(key: str, text: str, *former: str, table: tuple[str, ...] | None = None) -> str | None:
    client = CLIENTS[key]
    done = merge.take_out(client, text, (*(table or client.table), NAME), lambda _: True, former)
    assert isinstance(done, Edited), done
    return done.text


def members(text: str, path: tuple[str, ...] = ()) -> list[str]:
    """The texts of all members of the objects on the way to the servers, but for the way itself and our entry."""
    root = json_edit.scan(text)
    assert not isinstance(root, Unreadable)
    found: list[str] = []
    way = path
    while isinstance(root, Node) and root.members is not None:
        following = None
        for member in root.members:
            if way and member.key == way[0]:
                following = member.node
            elif member.key not in (NAME, "inputs"):
                found.append(text[member.start : member.node.end])
        root, way = following, way[1:]
    return found


# JSON in its dialects


@pytest.mark.parametrize("key", ["claude-code", "opencode", "vscode"])
@given(data=st.data())
def test_a_server_comes_into_any_json_and_goes_without_a_trace(key: str, data: st.DataObject) -> None:
    client = CLIENTS[key]
    content, text = data.draw(documents(client.table))
    assert json_edit.read(text) == content
    for url in (None, URL):
        if url and client.prompt and not isinstance(content.get("inputs", []), list):
            continue
        after = merged(key, text, url)
        wanted = json.loads(json.dumps(content))
        table = wanted
        for step in client.table:
            table = table.setdefault(step, {})
        table[NAME] = wish(key, url).entry
        if url and client.prompt:
            wanted.setdefault("inputs", []).append(client.prompt[1])
        found = json_edit.read(after)
        assert found == wanted
        assert members(after, client.table)[: len(members(text, client.table))] == members(text, client.table)
        assert merged(key, after, url) == after, "a second time changes nothing"
        assert taken_out(key, after, text) == text


@given(data=st.data())
def test_beside_other_servers_the_text_alone_leads_back(data: st.DataObject) -> None:
    _, text = data.draw(documents(populated=True))
    after = merged("cursor", text)
    path = ("mcpServers", NAME)
    assert json_edit.drop(after, path) == text


@given(data=st.data())
def test_what_came_in_meanwhile_stays_when_the_server_goes(data: st.DataObject) -> None:
    content, text = data.draw(documents())
    later = json_edit.put(merged("cursor", text), ("mcpServers", "later"), {"url": "x"})
    assert isinstance(later, str)
    left = taken_out("cursor", later, text)
    assert left is not None
    wanted = {**content, "mcpServers": {**content.get("mcpServers", {}), "later": {"url": "x"}}}
    assert json_edit.read(left) == wanted
    assert members(left, ("mcpServers",))[: len(members(text, ("mcpServers",)))] == members(text, ("mcpServers",))


STRICT = '{\n    "theme": "dark",\n    "mcpServers": {\n        "other": {"command": "x"}\n    },\n    "last": 1\n}\n'


@pytest.mark.parametrize(
    "text, after",
    [
        (
            STRICT,
            '{\n    "theme": "dark",\n    "mcpServers": {\n        "other": {"command": "x"},\n'
            '        "octoform-bench": {\n'
            '            "command": "p",\n            "args": []\n        }\n    },\n    "last": 1\n}\n',
        ),
        ('{"a":1}', '{"a":1,"mcpServers":{"octoform-bench":{"command":"p","args":[]}}}'),
        ('{"a": 1}', '{"a": 1, "mcpServers": {"octoform-bench": {"command": "p", "args": []}}}'),
        (
            "// mine\r\n{\r\n\t'a': 1, // one\r\n}\r\n",
            '// mine\r\n{\r\n\t\'a\': 1, // one\r\n\t"mcpServers": {\r\n\t\t"octoform-bench": {\r\n'
            '\t\t\t"command": "p",\r\n'
            '\t\t\t"args": []\r\n\t\t}\r\n\t},\r\n}\r\n',
        ),
        (
            '{\n  "mcpServers": {\n    // none yet\n  }\n}',
            '{\n  "mcpServers": {\n    // none yet\n    "octoform-bench": {\n      "command": "p",\n'
            '      "args": []\n    }\n  }\n}',
        ),
    ],
    ids=["four blanks", "tight", "one line", "tabs, comments, CRLF", "a comment alone"],
)
def test_the_new_text_has_the_form_of_the_old(text: str, after: str) -> None:
    entry = {"command": "p", "args": []}
    done = json_edit.put(text, ("mcpServers", NAME), entry)
    assert done == after


@pytest.mark.parametrize(
    "text, line, column",
    [
        ('{"a": 1', 1, 1),
        ('{\n  "a" 1\n}', 2, 7),
        ('{\n  "a": 1\n  "b": 2\n}', 3, 3),
        ('{"a": /* open', 1, 7),
        ("{'a: 1}", 1, 2),
        ('{"a": undefined}', 1, 7),
        ('{"a": 1} x', 1, 10),
        ("[1]", 1, 1),
        ("# yaml\na: 1\n", 1, 1),
        ('{"a": ' + "[" * 300 + "]" * 300 + "}", 1, 207),
    ],
)
def test_what_cannot_be_read_is_told_with_its_place(text: str, line: int, column: int) -> None:
    found = merge.merge(CLIENTS["cursor"], text, wish("cursor"), lambda _: True)
    assert isinstance(found, Unreadable)
    assert found.offset is not None
    before = text[: found.offset]
    assert (before.count("\n") + 1, found.offset - before.rfind("\n")) == (line, column), found.reason


@given(st.text(alphabet="{}[]:,\"'/* \n\\ab1", max_size=30))
def test_any_text_is_read_or_refused_and_never_worse(text: str) -> None:
    found = json_edit.read(text)
    done = json_edit.put(text, ("mcpServers", NAME), {"command": "p"})
    if isinstance(found, Unreadable):
        assert isinstance(done, Unreadable) or text.strip() == "[]"
    elif isinstance(done, str):
        assert at(json_edit.read(done), ("mcpServers", NAME)) == {"command": "p"}


@given(st.text(alphabet="{}[]:,\"'ab1 \n", max_size=40))
def test_whatever_json_reads_reads_the_same(text: str) -> None:
    try:
        value = json.loads(text)
    except ValueError:
        return
    node = json_edit.scan(text)
    assert isinstance(node, Node)
    assert node.value == value


def test_numbers_and_escapes_of_json5() -> None:
    text = r"""{hex: 0xFf, half: .5, whole: 5., plus: +1, neg: -0x10, far: Infinity, e: 1E2, 's': 'a\
b\x41\u00fc\ud83d\ude00\q\0',}"""
    assert json_edit.read(text) == {
        "hex": 255, "half": 0.5, "whole": 5.0, "plus": 1, "neg": -16, "far": float("inf"), "e": 100.0, "s": "abAü😀q\0",
    }  # fmt: skip


def test_a_name_that_stands_twice_on_the_way_is_not_guessed_at() -> None:
    text = '{"mcpServers": {}, "mcpServers": {}}'
    found = merge.merge(CLIENTS["cursor"], text, wish("cursor"), lambda _: True)
    assert isinstance(found, Unreadable)
    assert (found.offset, "second time" in found.reason) == (19, True)


@pytest.mark.parametrize("value", ["[]", '"x"', "1", "null"])
def test_a_place_of_another_kind_is_taken(value: str) -> None:
    text = '{"mcpServers": ' + value + "}"
    found = merge.merge(CLIENTS["cursor"], text, wish("cursor"), lambda _: True)
    assert isinstance(found, Taken)
    assert (found.path, found.offset, found.entry) == (("mcpServers",), 1, None)


def test_an_entry_of_somebody_else_is_taken_too() -> None:
    text = '{"mcpServers": {"octoform-bench": {"command": "mine"}}}'
    for done in (
        merge.merge(CLIENTS["cursor"], text, wish("cursor"), lambda _: False),
        merge.take_out(CLIENTS["cursor"], text, ("mcpServers", NAME), lambda _: False, []),
    ):
        assert isinstance(done, Taken)
        assert done.entry == {"command": "mine"}


def test_an_older_entry_keeps_the_fields_of_its_person() -> None:
    older = json.dumps(
        {"command": "/old/python", "args": list(COMMAND[1:]), "env": {"A": "1"}, "trust": True}, indent=2
    )
    text = '{\n "mcpServers": {\n  "octoform-bench": ' + older + " // fast\n }\n}\n"
    after = merged("gemini-cli", text)
    assert json_edit.read(after) == {
        "mcpServers": {NAME: {"command": COMMAND[0], "args": list(COMMAND[1:]), "env": {"A": "1"}, "trust": True}}
    }
    assert after == text.replace("/old/python", COMMAND[0])
    there = merge.merge(
        CLIENTS["gemini-cli"],
        text,
        Wish(("mcpServers",), NAME, wish("gemini-cli", URL).entry, dropped=frozenset({"command", "args"})),
        lambda _: True,
    )
    assert isinstance(there, Edited)
    assert there.text is not None
    assert json_edit.read(there.text) == {
        "mcpServers": {NAME: {"env": {"A": "1"}, "trust": True, **wish("gemini-cli", URL).entry}}
    }


def test_the_question_for_the_token_goes_with_the_last_server_that_needs_it() -> None:
    one = merged("vscode", '{"servers": {"x": {"command": "y"}}}', URL)
    two = json_edit.put(one, ("servers", "octoform-other"), wish("vscode", URL).entry)
    assert isinstance(two, str)
    left = taken_out("vscode", two)
    assert left is not None
    assert json_edit.read(left)["inputs"] == [CLIENTS["vscode"].prompt[1]]  # type: ignore[index]
    alone = json_edit.drop(one, ("servers", "x"))
    assert isinstance(alone, str)
    assert json_edit.read(taken_out("vscode", alone.replace("{", "{ ", 1)) or "") in ({}, {"servers": {}})


def test_what_is_shown_holds_no_secret_of_another_server() -> None:
    text = (
        '{"a":{"mcpServers":1},"mcpServers":{"x":{"env":{"KEY":"s3cret"}}},'
        '"inputs":[{"id":"k","d":"s3cret"}],"z":"s3cret"}'
    )
    for key, url in (("claude-code", None), ("vscode", URL)):
        done = merge.merge(CLIENTS[key], text, wish(key, url), lambda _: True)
        assert isinstance(done, Edited)
        assert done.hunks and "s3cret" not in str(done.hunks)
        assert NAME in str(done.hunks)
        back = merge.take_out(CLIENTS[key], done.text or "", (*CLIENTS[key].table, NAME), lambda _: True, [text])
        assert isinstance(back, Edited)
        assert back.hunks and "s3cret" not in str(back.hunks)


# TOML

TOMLS = [
    "",
    "# only a comment\n",
    'model = "x"\n',
    'model = "x"',
    '# top\nmodel = "x" # why\n\n[mcp_servers.other] # theirs\ncommand = "a"\nargs = [\n  "b", # c\n]\n'
    "\n# below\n[tui]\nx = 1\n",
    '[[list]]\na = 1\n\n[mcp_servers.other.env]\nA = "1"\n[[list]]\na = 2\n',
    'mcp_servers.other.command = "a"\r\n\r\n# end\r\n',
    'mcp_servers = { other = { command = "a" } } # inline\nlast = """\n[mcp_servers.octoform-bench]\n"""\n',
    'text = """\n[mcp_servers.octoform-bench]\ncommand = "no"\n"""\n',
]


@pytest.mark.parametrize("text", TOMLS)
@pytest.mark.parametrize("url", [None, URL])
def test_a_server_comes_into_toml_and_goes_without_a_trace(text: str, url: str | None) -> None:
    after = merged("codex", text, url)
    wanted = tomllib.loads(text)
    wanted.setdefault("mcp_servers", {})[NAME] = wish("codex", url).entry
    assert tomllib.loads(after) == wanted
    if "inline" not in text:
        assert after.startswith(text)
    assert ("\r\n" in text) == ("\r\n" in after) and (("\r\n" not in text) or after.count("\n") == after.count("\r\n"))
    assert merged("codex", after, url) == after
    assert taken_out("codex", after, text) == text or not text


@pytest.mark.parametrize(
    "text, left",
    [
        ('mcp_servers.octoform-bench.command = "x"\n# c\nmcp_servers.octoform-bench.args = []\n', "# c\n"),
        (
            '[mcp_servers]\noctoform-bench.command = "x" # c1\n# about\noctoform-bench.args = ["a"]\n# end\n[z]\na=1\n',
            "[mcp_servers]\n# about\n# end\n[z]\na=1\n",
        ),
        (
            '[mcp_servers]\n# head\noctoform-bench = {command="x"} # c\n# next\nother = {command="y"}\n',
            '[mcp_servers]\n# head\n# next\nother = {command="y"}\n',
        ),
        ('s = """\n[mcp_servers.octoform-bench]\n"""\n[mcp_servers.octoform-bench]\ncommand="x"\n', None),
    ],
)
def test_a_codex_table_goes_however_a_person_wrote_it(text: str, left: str | None) -> None:
    after = toml_text.drop(text, ("mcp_servers", NAME))
    assert isinstance(after, str), after
    wanted = tomllib.loads(text)
    del wanted["mcp_servers"][NAME]
    found = tomllib.loads(after)
    assert {**found, "mcp_servers": found.get("mcp_servers", {})} == wanted
    assert after == left or left is None


def test_a_codex_table_stays_when_a_comment_would_go_with_it() -> None:
    text = '[ mcp_servers . "octoform-bench" ] # h\ncommand="""\n[x]\n"""\n# of what comes next\n[[y]]\na=1\n'
    found = toml_text.drop(text, ("mcp_servers", NAME))
    assert isinstance(found, Unreadable)
    assert found.reason == "a comment would be lost"


def test_a_codex_table_goes_with_its_lines_alone_when_others_came_behind_it() -> None:
    text = merged("codex", 'model = "x"\n')
    later = text + '\n# the next\n[mcp_servers.next]\ncommand = "b"\n[mcp_servers.octoform-bench.env]\nA = "1"\n'
    left = taken_out("codex", later, 'model = "x"\n')
    assert left is None or "octoform" not in left
    assert left is not None
    assert tomllib.loads(left) == {"model": "x", "mcp_servers": {"next": {"command": "b"}}}
    assert '# the next\n[mcp_servers.next]\ncommand = "b"\n' in left


def test_an_older_codex_table_is_brought_up_to_date_with_its_comments() -> None:
    text = (
        merged("codex", "").replace(COMMAND[0], "/old") + "# slow board\ntool_timeout_sec = 90 # mine\n\n[x]\ny = 1\n"
    )
    after = merged("codex", text)
    assert after == text.replace("/old", COMMAND[0])


def test_a_toml_fault_has_its_place() -> None:
    found = merge.merge(CLIENTS["codex"], "a = 1\r\nb = = 2\r\n", wish("codex"), lambda _: True)
    assert isinstance(found, Unreadable)
    assert found.offset == 11
    assert isinstance(toml_text.read("a = "), Unreadable)


# YAML

YAMLS = [
    "",
    "# mine\n",
    "GOOSE_MODEL: x   # why\n",
    "GOOSE_MODEL: x",
    "GOOSE_MODEL: x\nextensions:\n  developer:\n    enabled: true # c\n    args:\n    - a\n    - 'b'\n\n"
    '# below\nlast: "q"\n',
    "extensions: {}\nlast: 1\n",
    "extensions:\nlast: 1\n",
    "extensions: # none\n",
    "extensions: ~ # none\n",
    "extensions: {developer: {enabled: true}} # flow\n",
    "extensions: {\n  developer: {enabled: true},\n}\n",
    "extensions:\r\n    developer:\r\n        text: |\r\n            a\r\n            b\r\n"
    "    other:\r\n        name: x\r\nz: 1\r\n",
    "a: &x {k: 1}\nb: *x\nextensions:\n  developer:\n    <<: *x\n",
]


@pytest.mark.parametrize("text", YAMLS)
@pytest.mark.parametrize("url", [None, URL])
def test_a_server_comes_into_yaml_and_goes_without_a_trace(text: str, url: str | None) -> None:
    after = merged("goose", text, url)
    plain = YAML(typ="safe")
    wanted: Any = plain.load(text) or {}
    wanted["extensions"] = {**(wanted.get("extensions") or {}), NAME: wish("goose", url).entry}
    assert plain.load(after) == wanted
    kept = [line for line in text.splitlines() if "extensions:" not in line]
    assert [line for line in after.splitlines() if line in kept] == kept or "extensions: {\n" in text
    assert after.count("\n") == after.count("\r\n") or "\r\n" not in text
    assert merged("goose", after, url) == after
    assert taken_out("goose", after, text) == text or not text


def test_goose_writes_its_file_anew_and_the_entry_is_still_found_and_removed() -> None:
    plain = YAML()
    plain.default_flow_style = False
    from io import StringIO

    out = StringIO()
    plain.dump({"extensions": {NAME: wish("goose").entry, "developer": {"enabled": True, "args": ["x"]}}, "z": 1}, out)
    text = out.getvalue()
    assert "- -I\n" in text
    assert merged("goose", text.replace(COMMAND[0], "/old")).count(COMMAND[0]) == 1
    left = taken_out("goose", text)
    assert left is not None
    assert yaml_text.read(left) == {"extensions": {"developer": {"enabled": True, "args": ["x"]}}, "z": 1}


@pytest.mark.parametrize("text", ["a: [", "- a\n", "a: 1\na: 2\n", "a: 1\n---\nb: 2\n", "\tb: 1\n"])
def test_yaml_that_is_not_one_mapping_is_refused(text: str) -> None:
    assert isinstance(merge.merge(CLIENTS["goose"], text, wish("goose"), lambda _: True), Unreadable)


@pytest.mark.parametrize("client", CLIENTS.values(), ids=list(CLIENTS))
def test_a_new_file_goes_as_it_came(client: Client) -> None:
    for url in (None, URL if client.http else None):
        text = merged(client.key, "", url)
        assert taken_out(client.key, text) is None
