"""Pseudonyms are final, and stand-ins keep the form of what they stand for."""

import copy
import json
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from unit.contracts.contract_samples import PROBE, SCHEMAS

from octoform.contracts import Artifacts
from octoform.contracts.contract_check import check
from octoform.contracts.host_identity import members, placeholder, pseudonymise, with_placeholders

KEY, OTHER = b"k" * 32, b"o" * 32
TEXT = st.text(st.sampled_from("abcdefABCDEF0123456789:- _redacted"), max_size=60)
NAMES = st.sampled_from(["serial", "mac_address", "hostname", "ssid", "port", "note"])


@given(
    hostname=TEXT,
    instance=st.dictionaries(NAMES, st.one_of(TEXT, st.lists(TEXT, max_size=2)), max_size=4),
    raw=TEXT,
    quoted=st.booleans(),
)
def test_what_was_hidden_once_is_not_hidden_again_under_any_key(
    hostname: str, instance: dict[str, Any], raw: str, quoted: bool
) -> None:
    probe = copy.deepcopy(PROBE)
    serial = instance.get("serial")
    text = f"{raw} {serial}{raw}" if quoted and isinstance(serial, str) else raw
    probe["hostname"] = hostname
    probe["devices"][0] |= {"instance": instance, "raw_descriptor": text}
    hidden = pseudonymise(probe, KEY)
    assert pseudonymise(hidden, OTHER) == hidden


def test_a_stand_in_has_the_same_form() -> None:
    for secret in ("AC00451177", "02:00:5e:10:00:01", "bench-seven", "Ünit 9"):
        found = placeholder(secret, KEY)
        assert found != secret
        assert [classified(sign) for sign in found] == [classified(sign) for sign in secret]
        assert placeholder(secret, KEY) == found != placeholder(secret, OTHER)


def classified(sign: str) -> str:
    kind = "digit" if sign.isdigit() else "hex" if sign.casefold() in "abcdef" else "letter"
    return (kind + str(sign.isupper())) if sign.isalnum() else sign


def test_the_spellings_of_one_value_get_one_stand_in() -> None:
    bare = [
        re.sub("[:_-]", "", placeholder(text, KEY)).casefold() for text in ("02:00:5E:10", "02-00-5e-10", "02005e10")
    ]
    assert len(set(bare)) == 1


def test_every_place_of_a_refused_output_is_exchanged_once() -> None:
    probe = copy.deepcopy(PROBE)
    probe["devices"][0]["id"] = "usb-1234-ac00451177"
    probe["devices"][0]["raw_descriptor"] = "serial AC00451177, mac 02:00:5e:10:00:01, again 0200-5e10-0001"
    probe["devices"][3]["id"] = "usb-02005e100001"
    text = with_placeholders(json.dumps(probe), ["bench-seven"], KEY, in_members=True)
    for secret in ("00451177", "02:00:5e:10:00:01", "02005e100001", "bench-seven"):
        assert secret not in text.casefold()
    found = json.loads(text)
    serial = found["devices"][0]["instance"]["serial"]
    assert serial == placeholder("AC00451177", KEY)
    assert found["devices"][0]["id"] == f"usb-1234-{serial.casefold()}"
    address = placeholder("02:00:5e:10:00:01", KEY)
    assert found["devices"][3]["instance"]["address"] == address
    assert f"serial {serial}, mac {address}, again" in found["devices"][0]["raw_descriptor"]


def test_the_rule_about_serial_numbers_still_refuses_it() -> None:
    probe = copy.deepcopy(PROBE)
    probe["devices"][0]["id"] = "usb-1234-ac00451177"
    exchanged = json.loads(with_placeholders(json.dumps(probe), [], KEY, in_members=True))
    before, after = (
        [(item.code, item.pointer) for item in check("probe", value, Artifacts(), SCHEMAS, "x")]
        for value in (probe, exchanged)
    )
    assert ("PROBE-SERIAL-IN-ID", "/devices/0/id") in before
    assert after == before


@pytest.mark.parametrize(
    "text", ['{"serial": "AC00451177', '"serial": "AC\\u00300451177"', '{"serial" : "a\\qb123456"}']
)
def test_what_is_no_json_is_exchanged_as_text(text: str) -> None:
    known = ["AC00451177"]
    assert "0451177" not in with_placeholders(text, known, KEY, in_members=True)


def test_members_are_found_in_broken_json() -> None:
    assert members('{"hostname": "bench", "serial": "redacted-0123456789", "name": "x", "mac": "aa" ') == [
        "bench",
        "aa",
    ]


@given(st.text(max_size=80))
def test_text_without_secrets_stays(text: str) -> None:
    assert with_placeholders(text, [], KEY, in_members=False) == text or ":" in text
