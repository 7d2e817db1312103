"""The agents of a loaded manifest: which one, with which model and key, at whose expense."""

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from octoform.diagnostics import Diagnostic
from octoform.manifest import model_url, yaml_tree
from octoform.manifest.credentials import APIS, PROVIDERS, SEARCHERS
from octoform.manifest.loader import load
from octoform.manifest.model import (
    KEEPERS,
    MODEL_FREE,
    STAGES,
    Escalation,
    HarnessSpec,
    Housekeeping,
    Manifest,
    Price,
    Sandbox,
)
from octoform.manifest.schema.harness import NAMES, table_of

AGENTS = ("claude-code", "codex", "gemini-cli", "litellm", "opencode", "pi", "qwen-code")


def read(folder: Path, text: str, environ: Mapping[str, str]) -> tuple[Manifest | None, list[Diagnostic]]:
    (folder / "octopus.yaml").write_text(f"version: 1\n{text}\n", "utf-8")
    return load(folder / "octopus.yaml", environ)


def loaded(folder: Path, text: str, **environ: str) -> Manifest:
    manifest, found = read(folder, text, environ)
    assert manifest is not None, found
    return manifest


@pytest.mark.parametrize("name", AGENTS)
def test_a_name_alone_is_enough(tmp_path: Path, name: str) -> None:
    model, key = {"gemini-cli": ("gemini/name", "GEMINI_API_KEY")}.get(
        name, ("openrouter/vendor/name", "OPENROUTER_API_KEY")
    )
    manifest = loaded(tmp_path, f"harness: {name}\nmodel: {model}")
    assert manifest.harness_for("serve") == HarnessSpec(name, key=key)
    assert manifest.model_for("serve") == model
    assert manifest.variables == (key,)


@pytest.mark.parametrize("name", AGENTS)
def test_a_name_in_a_table_is_the_same(tmp_path: Path, name: str) -> None:
    alone = loaded(tmp_path, f"harness: {name}\nmodel: a/b")
    assert loaded(tmp_path, f"harness: {{name: {name}}}\nmodel: a/b").stages == alone.stages


@pytest.mark.parametrize(
    ("own", "harness", "model"),
    [
        ("", "builtin", None),
        ("stages: {probe: {harness: codex}}", "codex", "openai/x"),
        ("stages: {probe: {model: openai/small}}", "pi", "openai/small"),
        ("stages: {probe: {harness: {name: command, command: [mine]}}}", "command", "openai/x"),
        ("stages: {probe: {budget: {attempts: 1}}}", "builtin", None),
    ],
)
def test_probe_is_the_embedded_agents_unless_another_is_named(
    tmp_path: Path, own: str, harness: str, model: str | None
) -> None:
    manifest = loaded(tmp_path, f"harness: pi\nmodel: openai/x\n{own}\n")
    assert (manifest.harness_for("probe").name, manifest.model_for("probe")) == (harness, model)
    assert manifest.harness_for("identify").name == "pi"


def test_every_setting_of_a_program(tmp_path: Path) -> None:
    manifest = loaded(
        tmp_path,
        "harness: {name: codex, command: [node, '${DIR}/codex'], env: [A, B], key: LOOP_KEY, api: openai-responses,\n"
        "  base_url: 'http://127.0.0.1:${PORT}', web_search: true, sandbox: {network: true}}\nmodel: openai/x",
        DIR="/opt",
        PORT="80",
    )
    assert manifest.harness_for("identify") == HarnessSpec(
        name="codex",
        command=("node", "${DIR}/codex"),
        env=("A", "B"),
        key="LOOP_KEY",
        base_url="http://127.0.0.1:${PORT}",
        api="openai-responses",
        web_search=True,
        sandbox=Sandbox(required=True),
    )
    assert manifest.variables == ("A", "B", "DIR", "LOOP_KEY", "PORT")


@pytest.mark.parametrize(
    ("harness", "model", "key"),
    [
        ("pi", "anthropic/x", "ANTHROPIC_API_KEY"),
        ("pi", "bare", "OPENAI_API_KEY"),
        ("claude-code", "bare", "ANTHROPIC_API_KEY"),
        ("gemini-cli", "bare", "GEMINI_API_KEY"),
        ("claude-code", "openrouter/anthropic/x", "OPENROUTER_API_KEY"),
        ("litellm", "google/x", "GEMINI_API_KEY"),
        ("litellm", "nobody/x", "OPENAI_API_KEY"),
        ("opencode", "ollama/x", None),
        ("opencode", "${M}", "GROQ_API_KEY"),
        ("{name: pi, key: OWN}", "anthropic/x", "OWN"),
        ("{name: pi, key: OWN}", "ollama/x", "OWN"),
        ("{name: pi, base_url: 'http://127.0.0.1:8'}", "anthropic/x", None),
        ("{name: pi, base_url: 'http://[::1]/v1'}", "anthropic/x", None),
        ("{name: pi, base_url: 'http://localhost:8'}", "anthropic/x", None),
        ("{name: pi, base_url: '${U}'}", "anthropic/x", None),
        ("{name: pi, base_url: 'http://127.0.0.1:8', key: OWN}", "anthropic/x", "OWN"),
        ("{name: pi, base_url: 'http://10.0.0.1:8'}", "anthropic/x", "ANTHROPIC_API_KEY"),
        ("{name: pi, base_url: 'http://127.0.0.1.example.org'}", "anthropic/x", "ANTHROPIC_API_KEY"),
    ],
)
def test_the_key_is_the_named_one_or_the_usual_one(tmp_path: Path, harness: str, model: str, key: str | None) -> None:
    environ = {"M": "groq/x", "U": "https://127.9.9.9"}
    manifest, found = read(tmp_path, f"harness: {harness}\nmodel: {model}", environ)
    assert manifest is not None
    assert {stage.harness.key for name, stage in manifest.stages.items() if name != "probe"} == {key}
    referred = {name for name in environ if f"${{{name}}}" in harness + model}
    assert set(manifest.variables) == referred | ({key} if key else set())
    assert [item.code for item in found] == (["MANIFEST-ENV-UNSET"] if key else [])
    assert [
        item.code for item in read(tmp_path, f"harness: {harness}\nmodel: {model}", environ | {str(key): "x"})[1]
    ] == []


def test_no_value_of_a_variable_is_kept(tmp_path: Path) -> None:
    values = {"M": "groq/value-of-m", "U": "https://value-of-u.example.org", "K": "value-of-k"}
    text = "harness: {name: pi, key: K, base_url: '${U}/v1'}\nmodel: ${M}\nprices: {'${M}': {input: 1, output: 2}}"
    manifest = loaded(tmp_path, text, **values)
    assert not any(word in repr(manifest) for word in ("value-of-m", "value-of-u", "value-of-k"))
    assert manifest.prices == {"${M}": Price(1.0, 1.0, 2.0)}
    assert manifest.digest == loaded(tmp_path, text, M="openai/x", U="http://[::1]", K="y").digest


@pytest.mark.parametrize(
    ("written", "sandbox"),
    [
        ("auto", Sandbox()),
        ("true", Sandbox(required=True)),
        ("false", None),
        ("{}", Sandbox(required=True)),
        ("{network: true}", Sandbox(required=True)),
        ("{network: false}", Sandbox(network=False, required=True)),
    ],
)
def test_sandbox(tmp_path: Path, written: str, sandbox: Sandbox | None) -> None:
    asking = ("pi", "litellm") if sandbox is None or sandbox.network else ()
    for harness in (*asking, "command, command: [agent]"):
        manifest = loaded(tmp_path, f"harness: {{name: {harness}, sandbox: {written}}}\nmodel: ollama/x")
        assert manifest.harness_for("serve").sandbox == sandbox


@pytest.mark.parametrize("harness", ["pi", "litellm", "codex, base_url: 'http://127.0.0.1:8080'"])
def test_no_agent_with_a_model_is_without_a_network(tmp_path: Path, harness: str) -> None:
    _, found = read(tmp_path, f"harness: {{name: {harness}, sandbox: {{network: false}}}}\nmodel: ollama/x", {})
    assert [(item.code, item.severity.value) for item in found] == [("MANIFEST-WRONG-VALUE", "error")]
    assert "cannot reach its model" in found[0].summary


@pytest.mark.parametrize(
    ("value", "words"), [("", "is empty"), (" ", "is empty"), ("k-1\n", "line break"), ("a b", "blanks")]
)
@pytest.mark.parametrize("harness", ["pi", "{name: pi, key: OPENAI_API_KEY}"])
def test_a_key_that_is_none_is_warned_of(tmp_path: Path, value: str, words: str, harness: str) -> None:
    _, found = read(tmp_path, f"harness: {harness}\nmodel: openai/x", {"OPENAI_API_KEY": value})
    assert [item.code for item in found] == ["MANIFEST-ENV-UNSET"]
    assert words in found[0].summary
    assert "k-1" not in str(found)


def test_a_recording_is_absolute_and_has_no_model(tmp_path: Path) -> None:
    (tmp_path / "recordings" / "bench").mkdir(parents=True)
    manifest = loaded(tmp_path, "harness: {name: replay, recording: ./recordings//bench/}\nmodel: a/b")
    assert manifest.harness_for("serve") == HarnessSpec("replay", recording=tmp_path / "recordings" / "bench")
    assert manifest.model_for("serve") is None
    assert manifest.variables == ()


def test_a_recording_that_links_outside_is_refused(tmp_path: Path) -> None:
    outside, project = tmp_path / "outside", tmp_path / "project"
    for folder in (outside, project):
        folder.mkdir()
    (project / "bench").symlink_to(outside)
    (project / "inside").mkdir()
    (project / "link").symlink_to("inside")
    for name, codes in (("bench", ["MANIFEST-BAD-RECORDING"]), ("link", [])):
        _, found = read(project, f"harness: {{name: replay, recording: {name}}}", {})
        assert [item.code for item in found] == codes


def test_budgets_and_prices(tmp_path: Path) -> None:
    manifest = loaded(
        tmp_path,
        "harness: pi\nmodel: ollama/x\n"
        "budget: {idle_timeout: 90s, turns: 60, usd: 5, edit_specs: false}\n"
        "stages: {serve: {budget: {idle_timeout: 2m, turns: 7, usd: 1.5}}}\n"
        "prices: {ollama/x: {input: 2, cached: 0.5, output: 6}}",
    )
    probe, serve = manifest.budget_for("probe"), manifest.budget_for("serve")
    assert (probe.idle_seconds, probe.turns, probe.usd, probe.edit_specs) == (90.0, 60, None, False)
    assert (serve.idle_seconds, serve.turns, serve.usd, serve.edit_specs) == (120.0, 7, 1.5, False)
    assert manifest.run_usd == 5.0
    assert manifest.prices == {"ollama/x": Price(2.0, 0.5, 6.0)}
    assert manifest.settings_for("interface") == {"tools": 30}


def test_escalation(tmp_path: Path) -> None:
    manifest = loaded(tmp_path, "stages: {identify: {escalate: {harness: pi}}}\nmodel: anthropic/x")
    assert manifest.stages["identify"].escalate == Escalation(HarnessSpec("pi", key="ANTHROPIC_API_KEY"), "anthropic/x")
    assert manifest.harness_for("identify") == HarnessSpec("builtin")
    assert manifest.model_for("identify") is None
    assert all(manifest.stages[name].escalate is None for name in ("probe", "interface", "serve", "deploy"))
    assert manifest.variables == ("ANTHROPIC_API_KEY",)
    own = "stages: {identify: {escalate: {harness: {name: command, command: [a], env: [E]}, model: b/c}}}\nmodel: a/b"
    escalate = loaded(tmp_path, own, E="x").stages["identify"].escalate
    assert escalate == Escalation(HarnessSpec("command", ("a",), ("E",)), "b/c")


def test_housekeeping(tmp_path: Path) -> None:
    assert loaded(tmp_path, "").housekeeping is None
    found = loaded(tmp_path, "housekeeping: {model: groq/x}")
    assert found.housekeeping == Housekeeping("groq/x", 800, "GROQ_API_KEY", None)
    assert found.variables == ("GROQ_API_KEY",)
    found = loaded(tmp_path, "housekeeping: {model: groq/x, max_tokens: 64, base_url: 'http://127.0.0.1:1'}")
    assert found.housekeeping == Housekeeping("groq/x", 64, None, "http://127.0.0.1:1")


@pytest.mark.parametrize("name", AGENTS)
def test_the_model_that_a_hint_names_is_one_for_the_harness(tmp_path: Path, name: str) -> None:
    _, found = read(tmp_path, f"harness: {name}", {})
    [hint] = {each.hint for each in found if each.code == "MANIFEST-NO-MODEL"}
    [model] = re.findall("`(model: .*)`", hint or "")
    keys = {each.key: "k" for each in PROVIDERS.values() if each.key}
    assert read(tmp_path, f"harness: {name}\n{model}\nbudget: {{usd: 3.00}}", keys)[1] == []


def test_the_digest_does_not_move_for_settings_that_are_not_used(tmp_path: Path) -> None:
    """The value is that of the version before these settings: what stands in states must stay comparable."""
    plain = loaded(tmp_path, "").digest
    assert plain == "sha256:400ce40b1f3f6379da02d2756531423078e042547f7bd71ad5c151d66e34c5a6"
    defaults = "budget: {turns: 100, edit_specs: true}\nprices: {}"
    assert loaded(tmp_path, defaults).digest == plain
    changes = (
        "budget: {idle_timeout: 60s}",
        "budget: {turns: 99}",
        "budget: {usd: 1}",
        "budget: {edit_specs: false}",
        "prices: {a: {input: 1, output: 1}}",
        "housekeeping: {model: ollama/x}",
        "stages: {identify: {escalate: {harness: {name: pi, key: K}, model: ollama/x}}}",
        "stages: {serve: {budget: {turns: 5}}}",
    )
    digests = {loaded(tmp_path, text).digest for text in changes}
    assert len(digests | {plain}) == len(changes) + 1


def test_names_are_complete() -> None:
    assert set(NAMES) == {*AGENTS, *MODEL_FREE, "command"}
    assert set(SEARCHERS) < set(AGENTS)
    assert all(set(provider.urls) <= set(APIS) for provider in PROVIDERS.values())
    for name in NAMES:
        assert "name" in table_of(name).model_fields
    assert len(yaml_tree.HARNESSES) == 1 + len((*STAGES, *KEEPERS)) + len(("escalation",))


@pytest.mark.parametrize(
    ("url", "is_one"),
    [
        ("http://h", True),
        ("https://h:1/v1", True),
        ("http://[::1]:8080/", True),
        ("HTTP://h", True),
        ("http://h:0", False),
        ("http://[::1", False),
        ("h:80", False),
        ("//h", False),
        ("http://u@h", False),
        ("http://h/a?b", False),
        ("http://h/#", False),
        ("http://h/a b", False),
        ("", False),
    ],
)
def test_base_urls(url: str, is_one: bool) -> None:
    assert (model_url.url_complaint(url) is None) == is_one


@pytest.mark.parametrize(
    ("name", "model", "variable"),
    [
        ("claude-code", "anthropic/x", "CLAUDE_CODE_OAUTH_TOKEN"),
        ("claude-code", "x", "CLAUDE_CODE_OAUTH_TOKEN"),
        ("codex", "openai/x", "CODEX_ACCESS_TOKEN"),
    ],
)
def test_a_login_stands_in_for_the_key_and_is_no_unset_variable(
    tmp_path: Path, name: str, model: str, variable: str
) -> None:
    manifest, found = read(tmp_path, f"harness: {{name: {name}, login: true}}\nmodel: {model}", {})
    assert manifest is not None and found == []
    assert manifest.harness_for("serve") == HarnessSpec(name, key=variable, login=True)
    assert manifest.variables == (variable,), "what it holds is blanked out like a key"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("harness: {name: pi, login: true}\nmodel: anthropic/x", "octoform can use no login of `pi`"),
        ("harness: {name: codex, login: true, key: K}\nmodel: openai/x", "`login` and `key` exclude each other"),
        ("harness: {name: codex, login: true}\nmodel: anthropic/x", "one with openai, and the model is of anthropic"),
    ],
)
def test_a_login_that_cannot_be_used(tmp_path: Path, text: str, said: str) -> None:
    _, found = read(tmp_path, text, {"K": "k", "ANTHROPIC_API_KEY": "k"})
    (problem,) = [each for each in found if each.code == "MANIFEST-WRONG-VALUE"]
    assert said in problem.summary and problem.span is not None and problem.span.line == 2
