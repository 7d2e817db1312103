"""A client's own file on disk: nothing of it is lost, and it is left alone where it is not ours to change."""

import json
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from octoform.diagnostics import Diagnostic
from octoform.endpoint.mcp_clients import install
from octoform.endpoint.mcp_clients.install import Outcome, Reach, Server
from octoform.endpoint.mcp_clients.known_clients import CLIENTS, Client, Surroundings

COMMAND = ("/venv/bin/python", "-I", "-m", "octoform.cli", "-chdir=/home/me/rig", "connect", "bench")
SERVER = Server("octoform-bench", COMMAND)
REACH = Reach(http=True)
URL = "http://10.0.0.2:7777/mcp"
CURSOR = CLIENTS["cursor"]
OTHERS = '{\n  // mine\n  "mcpServers": {\n    "other": {"command": "x"},\n  },\n}\n'


@pytest.fixture
def around(tmp_path: Path) -> Surroundings:
    return Surroundings({"HOME": str(tmp_path)})


def put(around: Surroundings, data: str | bytes, client: Client = CURSOR) -> Path:
    path = install.file_of(client, around)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def done(outcome: Outcome | Diagnostic) -> Outcome:
    assert isinstance(outcome, Outcome), outcome
    return outcome


def refused(outcome: Outcome | Diagnostic) -> Diagnostic:
    assert isinstance(outcome, Diagnostic), outcome
    return outcome


@pytest.mark.parametrize("client", CLIENTS.values(), ids=list(CLIENTS))
def test_every_client_gets_the_endpoint_in_a_new_file_and_loses_it_again(client: Client, around: Surroundings) -> None:
    assert install.look(client, around, SERVER, REACH).state == "absent"
    outcome = done(install.install(client, around, SERVER))
    assert (outcome.state, outcome.transport, outcome.backup) == ("added", "stdio", None)
    assert stat.S_IMODE(outcome.file.stat().st_mode) == 0o600
    seen = install.look(client, around, SERVER, REACH)
    assert (seen.state, seen.transport, seen.there) == ("installed", "stdio", True)
    assert done(install.install(client, around, SERVER)).state == "present"
    assert done(install.remove(client, around, SERVER)).state == "removed"
    assert list(outcome.file.parent.iterdir()) == []
    assert done(install.remove(client, around, SERVER)).state == "absent"


@pytest.mark.parametrize("mode", [0o600, 0o644, 0o755])
@pytest.mark.parametrize("data", [OTHERS, OTHERS.replace("\n", "\r\n"), "\ufeff" + OTHERS, "", "\n", "{}"])
def test_remove_gives_back_the_bytes_and_the_mode(around: Surroundings, data: str, mode: int) -> None:
    path = put(around, data)
    path.chmod(mode)
    outcome = done(install.install(CURSOR, around, SERVER))
    assert path.read_bytes() != data.encode()
    assert path.read_bytes().startswith(b"\xef\xbb\xbf") == data.startswith("\ufeff")
    assert outcome.backup == path.with_name("mcp.json.octoform-backup-1")
    assert outcome.backup.read_bytes() == data.encode()
    assert {stat.S_IMODE(item.stat().st_mode) for item in path.parent.iterdir()} == {mode}
    done(install.remove(CURSOR, around, SERVER))
    assert [item.name for item in path.parent.iterdir()] == ["mcp.json"]
    assert (path.read_bytes(), stat.S_IMODE(path.stat().st_mode)) == (data.encode(), mode)


def test_a_linked_dotfile_is_written_through_the_link(around: Surroundings, tmp_path: Path) -> None:
    dotfiles = tmp_path / "dotfiles" / "mcp.json"
    dotfiles.parent.mkdir()
    dotfiles.write_text(OTHERS)
    path = install.file_of(CURSOR, around)
    path.parent.mkdir()
    path.symlink_to(Path("..") / "dotfiles" / "mcp.json")
    outcome = done(install.install(CURSOR, around, SERVER))
    assert path.is_symlink() and "octoform-bench" in dotfiles.read_text()
    assert outcome.backup is not None and outcome.backup.parent == path.parent
    assert [item.name for item in dotfiles.parent.iterdir()] == ["mcp.json"]
    done(install.remove(CURSOR, around, SERVER))
    assert path.is_symlink() and dotfiles.read_text() == OTHERS


def test_a_new_interpreter_is_brought_up_to_date_without_another_backup(around: Surroundings) -> None:
    path = put(around, OTHERS)
    done(install.install(CURSOR, around, SERVER))
    moved = Server(SERVER.name, ("/other/python", *COMMAND[1:]))
    outcome = done(install.install(CURSOR, around, moved))
    assert (outcome.state, outcome.backup) == ("updated", None)
    assert [hunk.added for hunk in outcome.hunks] != [] and "/other/python" in path.read_text()
    done(install.remove(CURSOR, around, moved))
    assert path.read_text() == OTHERS


def test_from_stdio_to_http_and_back(around: Surroundings) -> None:
    for client in (item for item in CLIENTS.values() if item.http is not None):
        path = put(around, "", client)
        done(install.install(client, around, SERVER))
        before = path.read_bytes()
        there = Server(SERVER.name, COMMAND, URL)
        assert done(install.install(client, around, there)).transport == "http"
        assert install.look(client, around, there, REACH).transport == "http"
        assert b"connect" not in path.read_bytes()
        moved = Server(SERVER.name, COMMAND, URL.replace("7777", "7778"))
        if client.reference:
            assert done(install.install(client, around, moved)).state == "updated"
            there = moved
        back = Server(SERVER.name, COMMAND) if client.reference else there
        if client.reference:
            assert done(install.install(client, around, back)).state == "updated"
            assert json.dumps(before.decode()).count("connect") == json.dumps(path.read_text()).count("connect")
        done(install.remove(client, around, back))


def test_at_most_three_backups_are_kept_of_a_file_that_lives(around: Surroundings) -> None:
    path = put(around, '{"n": 0}')
    for number in range(1, 6):
        done(install.install(CURSOR, around, SERVER))
        content = json.loads(path.read_text())
        path.write_text(json.dumps({**content, "n": number}))
        done(install.remove(CURSOR, around, SERVER))
        path.write_text(json.dumps({"n": number}))
    kept = install.backups(path)
    assert len(kept) == 3
    numbers = [int(item.name.rpartition("-")[2]) for item in kept]
    assert numbers == sorted(numbers, reverse=True) and numbers[-1] > 1


def test_what_the_client_wrote_meanwhile_stays(around: Surroundings) -> None:
    client = CLIENTS["claude-code"]
    path = put(around, '{\n  "numStartups": 3,\n  "oauth": {"t": "s3cret"}\n}', client)
    done(install.install(client, around, SERVER))
    path.write_text(path.read_text().replace('"numStartups": 3', '"numStartups": 4'))
    outcome = done(install.remove(client, around, SERVER))
    assert path.read_text() == '{\n  "numStartups": 4,\n  "oauth": {"t": "s3cret"}\n}'
    assert outcome.backup is not None, "the file with the client's own change is kept"


def test_a_file_that_changes_under_the_hand_is_merged_anew(
    around: Surroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = put(around, '{"a": 1}')
    real = install.replace_file
    times: list[int] = []

    def late(found: install.ConfigFile, data: bytes | None, mode: int) -> Any:
        times.append(1)
        if len(times) == 1:
            path.write_text('{"a": 2}')
        return real(found, data, mode)

    monkeypatch.setattr(install, "replace_file", late)
    outcome = done(install.install(CURSOR, around, SERVER))
    assert json.loads(path.read_text())["a"] == 2
    assert outcome.backup is not None and outcome.backup.read_text() == '{"a": 2}'
    assert len(install.backups(path)) == 1


@pytest.mark.parametrize(
    "data, code, line, column",
    [
        ('{\n  "mcpServers": {\n}', "CLIENT-FILE-SYNTAX", 1, 1),
        ('{\n  "a" 1\n}', "CLIENT-FILE-SYNTAX", 2, 7),
        (b'{\n "a": "\xff"\n}', "CLIENT-FILE-SYNTAX", 2, 8),
        (OTHERS.encode("utf-16"), "CLIENT-FILE-SYNTAX", 1, 1),
        ('{\n  "mcpServers": []\n}', "CLIENT-PLACE-TAKEN", 2, 3),
        ('{\n\t"mcpServers": {"octoform-bench": {"command": "x"}}\n}', "CLIENT-ENTRY-FOREIGN", 2, 17),
        ('{\n\t"mcpServers": {"octoform-bench": 1}\n}', "CLIENT-PLACE-TAKEN", 2, 17),
    ],
)
def test_a_file_that_cannot_be_changed_is_told_with_its_place(
    around: Surroundings, data: str | bytes, code: str, line: int, column: int
) -> None:
    path = put(around, data)
    found = refused(install.install(CURSOR, around, SERVER))
    assert (found.code, found.path) == (code, str(path))
    assert found.span is not None
    assert (found.span.line, found.span.column) == (line, column)
    assert path.read_bytes() == (data if isinstance(data, bytes) else data.encode())
    assert [item.name for item in path.parent.iterdir()] == ["mcp.json"]
    if code != "CLIENT-PLACE-TAKEN":
        assert install.look(CURSOR, around, SERVER, REACH).state in ("unreadable", "foreign")


def test_an_entry_of_another_project_is_shown_beside_ours_without_its_secrets(around: Surroundings) -> None:
    entry = {"command": "/p", "args": [*COMMAND[1:4], "-chdir=/elsewhere", "connect", "bench"], "env": {"K": "s3cret"}}
    path = put(around, json.dumps({"mcpServers": {"octoform-bench": entry}}))
    before = path.read_bytes()
    for found in (install.install(CURSOR, around, SERVER), install.remove(CURSOR, around, SERVER)):
        problem = refused(found)
        assert problem.code == "CLIENT-ENTRY-FOREIGN"
        assert "-chdir=/elsewhere" in str(problem.detail) and "s3cret" not in str(problem)
    assert path.read_bytes() == before


def test_files_that_are_not_ours_to_write_are_left_alone(around: Surroundings, tmp_path: Path) -> None:
    path = put(around, OTHERS)
    path.chmod(0o444)
    assert "read-only" in refused(install.install(CURSOR, around, SERVER)).summary
    path.chmod(0o644)
    (tmp_path / "second").hardlink_to(path)
    assert "hard links" in refused(install.install(CURSOR, around, SERVER)).summary
    path.unlink()
    path.mkdir()
    assert "no regular file" in refused(install.install(CURSOR, around, SERVER)).summary
    path.rmdir()
    path.symlink_to(path)
    assert refused(install.install(CURSOR, around, SERVER)).code == "CLIENT-UNWRITABLE"
    path.unlink()
    path.parent.rmdir()
    path.parent.write_text("a file where the folder belongs")
    assert refused(install.install(CURSOR, around, SERVER)).code == "CLIENT-UNWRITABLE"


def test_a_file_of_another_user_is_left_alone(around: Surroundings, monkeypatch: pytest.MonkeyPatch) -> None:
    path = put(around, OTHERS)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    assert "another user" in refused(install.install(CURSOR, around, SERVER)).summary
    assert path.read_text() == OTHERS


def test_a_written_token_is_for_nobody_else_and_is_not_shown(around: Surroundings) -> None:
    client = CLIENTS["lm-studio"]
    path = put(around, "{}", client)
    path.chmod(0o644)
    server = Server(SERVER.name, COMMAND, URL, "octoform_s3cret")
    outcome = done(install.install(client, around, server))
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    headers = json.loads(path.read_text())["mcpServers"]["octoform-bench"]["headers"]
    assert headers == {"Authorization": "Bearer octoform_s3cret"}
    assert "s3cret" not in str(outcome.hunks) and "Bearer [token]" in str(outcome.hunks)


@pytest.mark.parametrize(
    "data, way",
    [
        ("", ("mcp", "servers")),
        ('{"mcp": {}}', ("mcp", "servers")),
        ('{"mcp": {"servers": {}}}', ("mcp", "servers")),
        ('{"mcp": {"timeout": 5}}', ("mcp", "servers")),
        ('{"mcp": {"a": {"type": "local", "command": ["x"]}}}', ("mcp",)),
        ('{"mcp": {"a": {"enabled": false}}}', ("mcp",)),
        ('{"mcp": {"a": {"type": "local"}, "servers": {"b": {"type": "local"}}}}', ("mcp", "servers")),
        ('{"mcp": {"servers": {"type": "local", "command": ["x"]}}}', ("mcp",)),
    ],
)
def test_opencodes_notation_is_that_of_the_file(around: Surroundings, data: str, way: tuple[str, ...]) -> None:
    client = CLIENTS["opencode"]
    path = put(around, data, client)
    done(install.install(client, around, SERVER))
    content = json.loads(path.read_text())
    for key in way:
        content = content[key]
    assert content["octoform-bench"] == {"type": "local", "command": list(COMMAND)}
    assert done(install.install(client, around, SERVER)).state == "present"
    done(install.remove(client, around, SERVER))
    assert path.read_text() == data


@pytest.mark.parametrize(
    "client, environ, platform, path",
    [
        ("claude-code", {"HOME": "/h"}, "linux", "/h/.claude.json"),
        ("claude-code", {"HOME": "/h", "CLAUDE_CONFIG_DIR": "/c"}, "linux", "/c/.claude.json"),
        ("claude-desktop", {"HOME": "/h"}, "linux", "/h/.config/Claude/claude_desktop_config.json"),
        (
            "claude-desktop",
            {"HOME": "/h"},
            "darwin",
            "/h/Library/Application Support/Claude/claude_desktop_config.json",
        ),
        ("claude-desktop", {"APPDATA": "/r"}, "win32", "/r/Claude/claude_desktop_config.json"),
        ("codex", {"HOME": "/h"}, "linux", "/h/.codex/config.toml"),
        ("codex", {"HOME": "/h", "CODEX_HOME": "/c"}, "darwin", "/c/config.toml"),
        ("gemini-cli", {"HOME": "/h", "GEMINI_CLI_HOME": "/g"}, "linux", "/g/.gemini/settings.json"),
        ("cursor", {"HOME": "/h"}, "linux", "/h/.cursor/mcp.json"),
        ("cursor", {"USERPROFILE": "/u"}, "win32", "/u/.cursor/mcp.json"),
        ("vscode", {"HOME": "/h", "XDG_CONFIG_HOME": "/x"}, "linux", "/x/Code/User/mcp.json"),
        ("vscode", {"HOME": "/h", "VSCODE_PORTABLE": "/p"}, "linux", "/p/user-data/User/mcp.json"),
        ("vscode", {"HOME": "/h"}, "darwin", "/h/Library/Application Support/Code/User/mcp.json"),
        ("opencode", {"HOME": "/h", "XDG_CONFIG_HOME": "/x"}, "darwin", "/x/opencode/opencode.jsonc"),
        ("goose", {"HOME": "/h"}, "darwin", "/h/.config/goose/config.yaml"),
        ("goose", {"APPDATA": "/r"}, "win32", "/r/Block/goose/config/config.yaml"),
        ("goose", {"HOME": "/h", "GOOSE_PATH_ROOT": "/g"}, "linux", "/g/config/config.yaml"),
        ("lm-studio", {"HOME": "/h"}, "linux", "/h/.lmstudio/mcp.json"),
        ("openclaw", {"HOME": "/h"}, "linux", "/h/.openclaw/openclaw.json"),
        ("openclaw", {"HOME": "/h", "OPENCLAW_HOME": "/o"}, "linux", "/o/.openclaw/openclaw.json"),
        ("openclaw", {"HOME": "/h", "OPENCLAW_STATE_DIR": "/s"}, "linux", "/s/openclaw.json"),
        ("openclaw", {"HOME": "/h", "OPENCLAW_CONFIG_PATH": "/f.json"}, "linux", "/f.json"),
    ],
)
def test_each_client_has_its_file(client: str, environ: dict[str, str], platform: str, path: str) -> None:
    assert install.file_of(CLIENTS[client], Surroundings(environ, platform)) == Path(path)


def test_the_file_that_is_there_goes_before_the_preferred_one(around: Surroundings, tmp_path: Path) -> None:
    there = tmp_path / ".config" / "opencode" / "opencode.json"
    there.parent.mkdir(parents=True)
    there.write_text("{}")
    assert install.file_of(CLIENTS["opencode"], around) == there


def test_an_entry_is_found_in_whichever_of_the_clients_files_it_stands(around: Surroundings, tmp_path: Path) -> None:
    client = CLIENTS["opencode"]
    folder = tmp_path / ".config" / "opencode"
    folder.mkdir(parents=True)
    (folder / "opencode.json").write_text("{}")
    done(install.install(client, around, SERVER))
    (folder / "opencode.jsonc").write_text('{"$schema": "x"}')
    assert install.look(client, around, SERVER, REACH).file == folder / "opencode.json"
    assert done(install.install(client, around, SERVER)).state == "present"
    assert done(install.remove(client, around, SERVER)).state == "removed"
    assert (folder / "opencode.json").read_text() == "{}"


@pytest.mark.parametrize("client", CLIENTS.values(), ids=list(CLIENTS))
def test_an_entry_is_current_while_it_is_what_would_be_written_now(client: Client, around: Surroundings) -> None:
    def current(reach: Reach, command: tuple[str, ...] = COMMAND) -> bool:
        seen = install.look(client, around, Server(SERVER.name, command, reach.urls[0] if reach.urls else None), reach)
        assert seen.state == "installed"
        return seen.current

    done(install.install(client, around, SERVER))
    assert current(Reach(http=False)) and current(Reach(http=True)) and current(Reach(True, (URL,)))
    assert not current(Reach(http=False), ("/other/python", *COMMAND[1:]))
    if client.http is None:
        return
    bearer = None if client.reference else "octoform_value"
    done(install.install(client, around, Server(SERVER.name, COMMAND, URL, bearer)))
    tokens = ("octoform_other", "octoform_value")
    assert current(Reach(True, (URL,), tokens)) and current(Reach(True, (), tokens))
    assert current(Reach(True, ("https://tunnel.example.org/mcp", URL), tokens))
    assert not current(Reach(True, (URL.replace("7777", "7778"),), tokens))
    assert not current(Reach(http=False, tokens=tokens))
    assert current(Reach(True, (URL,), ("octoform_rotated",))) == (bearer is None)
