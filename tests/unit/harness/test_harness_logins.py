"""The login that a person has with a program: found where the program keeps it, and never the part that renews it."""

import base64
import json
from pathlib import Path
from typing import Any

import pytest

from octoform.diagnostics import Diagnostic
from octoform.harness.llm.route import Access, access
from octoform.harness.logins import Found, find
from octoform.manifest.credentials import LOGINS, RESPONSES
from octoform.manifest.model import HarnessSpec

NOW = 1_800_000_000.0
CLAUDE, CODEX = HarnessSpec("claude-code", login=True), HarnessSpec("codex", login=True)


def kept(home: Path, place: str, document: Any) -> dict[str, str]:
    """The person's environment, once the program has written its file."""
    path = home / place
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return {"HOME": str(home)}


def claude(home: Path, seconds: float, **more: Any) -> dict[str, str]:
    """Claude Code's file, with a token that ends so many seconds from now."""
    login = {"accessToken": "at-1", "refreshToken": "rt-1", "expiresAt": (NOW + seconds) * 1000, **more}
    return kept(home, ".claude/.credentials.json", {"claudeAiOauth": login})


def codex(home: Path, seconds: float) -> dict[str, str]:
    """Codex's file; its token has its own expiry."""
    claims = base64.urlsafe_b64encode(json.dumps({"exp": NOW + seconds}).encode()).decode().rstrip("=")
    tokens = {"id_token": "id-1", "access_token": f"h.{claims}.s", "refresh_token": "rt-1", "account_id": "account-7"}
    return kept(home, ".codex/auth.json", {"auth_mode": "chatgpt", "OPENAI_API_KEY": None, "tokens": tokens})


def refused(found: Found | Diagnostic) -> str:
    assert isinstance(found, Diagnostic) and found.code == "HARNESS-LOGIN", found
    return found.summary


def test_the_token_of_claude_code_and_when_it_ends(tmp_path: Path) -> None:
    environ = claude(tmp_path, 3600)
    place = str(tmp_path / ".claude/.credentials.json")
    assert find(CLAUDE, environ, NOW) == Found({"CLAUDE_CODE_OAUTH_TOKEN": "at-1"}, place, NOW + 3600)


def test_the_token_of_codex_with_the_account_that_it_is_of(tmp_path: Path) -> None:
    found = find(CODEX, codex(tmp_path, 86_400), NOW)
    assert isinstance(found, Found)
    assert set(found.variables) == {"CODEX_ACCESS_TOKEN", "CODEX_ACCOUNT_ID"}
    assert found.variables["CODEX_ACCOUNT_ID"] == "account-7"
    assert found.until == NOW + 86_400
    assert "rt-1" not in str(found.variables), "anyone who renews a login makes its owner's void"


def test_a_variable_that_the_person_has_set_comes_first(tmp_path: Path) -> None:
    environ = claude(tmp_path, -1) | {"CLAUDE_CODE_OAUTH_TOKEN": "of setup-token"}
    assert find(CLAUDE, environ, NOW) == Found({}, "CLAUDE_CODE_OAUTH_TOKEN", None)


@pytest.mark.parametrize("variable", ["CLAUDE_CONFIG_DIR", "CODEX_HOME"])
def test_the_folder_that_the_program_was_told(tmp_path: Path, variable: str) -> None:
    spec, make = (CLAUDE, claude) if variable.startswith("CLAUDE") else (CODEX, codex)
    make(tmp_path, 3600)
    folder = tmp_path / (".claude" if spec is CLAUDE else ".codex")
    assert isinstance(find(spec, {"HOME": "/nowhere", variable: str(folder)}, NOW), Found)


@pytest.mark.parametrize("seconds", [-60, 0, 599])
def test_a_login_that_has_ended_or_is_about_to(tmp_path: Path, seconds: float) -> None:
    assert "has ended, or ends within ten minutes" in refused(find(CLAUDE, claude(tmp_path, seconds), NOW))
    assert "has ended, or ends within ten minutes" in refused(find(CODEX, codex(tmp_path, seconds), NOW))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "cannot be read"),
        ("[" * 100_000, "cannot be read"),
        ("[]", "holds no login"),
        ('{"claudeAiOauth": []}', "holds no login"),
        ('{"claudeAiOauth": {"accessToken": 5}}', "holds no login"),
        ('{"claudeAiOauth": {"accessToken": ""}}', "holds no login"),
        ('{"claudeAiOauth": {"accessToken": "a\\nb"}}', "holds no login"),
    ],
)
def test_a_file_that_holds_no_login(tmp_path: Path, text: str, why: str) -> None:
    environ = kept(tmp_path, ".claude/.credentials.json", text)
    assert why in refused(find(CLAUDE, environ, NOW))


def test_no_file_says_how_to_log_in(tmp_path: Path) -> None:
    found = find(CLAUDE, {"HOME": str(tmp_path)}, NOW)
    assert f"there is no {tmp_path}/.claude/.credentials.json" in refused(found)
    assert isinstance(found, Diagnostic) and found.hint is not None and "claude setup-token" in found.hint


@pytest.mark.parametrize("token", ["at-1", "a.b", "a.!!!.c", "a.WzFd.c"])
def test_a_token_that_says_nothing_of_its_end_is_taken(tmp_path: Path, token: str) -> None:
    environ = kept(tmp_path, ".codex/auth.json", {"tokens": {"access_token": token}})
    assert find(CODEX, environ, NOW) == Found({"CODEX_ACCESS_TOKEN": token}, str(tmp_path / ".codex/auth.json"), None)


def test_a_subscription_of_codex_is_asked_elsewhere_than_the_api() -> None:
    way = access(HarnessSpec("codex", key="CODEX_ACCESS_TOKEN", login=True), "openai/model", (RESPONSES,), {})
    assert isinstance(way, Access) and way.base_url == LOGINS["codex"].url
