"""The published schema: current, valid, and of one mind with what octoform accepts."""

from functools import cache
from pathlib import Path

from cases import for_each
from jsonschema import Draft202012Validator
from manifest_cases import Case, all_cases
from ruamel.yaml import YAML

from octoform.manifest.schema.document import json_schema, text

ROOT = Path(__file__).parents[3]
PUBLISHED = ROOT / "protocol" / "schemas" / "octopus.v1.schema.json"
# What a JSON Schema cannot see: the file system, the environment, secrets, YAML itself, and what the text means.
BEYOND_A_SCHEMA = {
    "MANIFEST-MISSING-PROFILE",
    "MANIFEST-BAD-PROFILE",
    "MANIFEST-PROFILE-OUTSIDE",
    "MANIFEST-BAD-RECORDING",
    "MANIFEST-NO-MODEL",
    "MANIFEST-ENV-UNSET",
    "MANIFEST-ENV-NOT-ALLOWED",
    "MANIFEST-SECRET",
    "MANIFEST-ANCHOR",
    "MANIFEST-TAG",
    "MANIFEST-DUPLICATE-KEY",
    "MANIFEST-CONTROL-CHARACTER",
    "MANIFEST-TOO-LARGE",
    "MANIFEST-DOCUMENTS",
    "MANIFEST-SYNTAX",
    "MANIFEST-TAB",
    "MANIFEST-ENCODING",
    "MANIFEST-MORE",
    "MANIFEST-BAD-KEY",
    "MANIFEST-SCOPE",
}
IN_THE_WORDS = {
    "agent-that-cannot-talk-to-the-provider",
    "agent-without-network",
    "answers-hidden-character",
    "durations",
    "harness-placeholders",
    "version-with-point",
    "variable-not-well-formed",
    "agent-placeholder-in-command",
    "api-not-of-the-provider",
    "base-url-variable-not-well-formed",
    "base-url-variable-with-another-value",
    "base-url-with-a-bad-port",
    "escalate-from-another-agent",
    "web-search-of-one-that-has-none",
    "network-interface-every-address",
    "network-interface-multicast",
    "network-interface-of-ipv6",
    "network-interface-with-colon",
    "policy-limit-minimum-above-maximum",
    "policy-limit-parameter-not-used",
    "policy-limit-quiet-hours-of-no-length",
    "policy-limit-rate-too-long",
    "policy-limit-without-parameter",
    "policy-timeout-out-of-range",
    "tunnel-placeholder",
    "tunnel-without-program",
    "tunnel-without-url",
}


def test_the_published_schema_is_current(update: bool) -> None:
    if update:
        PUBLISHED.write_text(text(), "utf-8")
    assert PUBLISHED.read_text("utf-8") == text()


def test_the_schema_is_valid_and_closed() -> None:
    schema = json_schema()
    Draft202012Validator.check_schema(schema)
    for table in (schema, *schema["$defs"].values()):
        assert table["additionalProperties"] is False
        assert all(
            "description" in setting or "$ref" in setting or "const" in setting
            for setting in table["properties"].values()
        )


def _agreeing() -> list[Case]:
    def is_for_the_schema(case: Case) -> bool:
        codes = {item["code"] for item in case.expected["diagnostics"] if item["severity"] == "error"}
        return not codes & BEYOND_A_SCHEMA and case.name not in IN_THE_WORDS

    return [case for case in all_cases() if is_for_the_schema(case)]


@cache
def validator() -> Draft202012Validator:
    return Draft202012Validator(json_schema())


@for_each("case", _agreeing())
def test_an_editor_and_octoform_agree(case: Case, tmp_path: Path) -> None:
    content = YAML(typ="safe", pure=True).load(case.project_in(tmp_path).read_text("utf-8"))
    is_valid = validator().is_valid(content)
    assert is_valid == (not case.is_bad)


def test_many_cases_are_for_the_schema() -> None:
    assert len(_agreeing()) >= 40
