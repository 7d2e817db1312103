"""Kinds and instances: what leaves the canonical form, what is hidden before git, and that both are stable."""

import copy
import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from unit.contracts.contract_samples import PROBE, SCHEMAS, good

from octoform.contracts import canonical, instances, output_digest, pseudonymise

KEY = b"k" * 32


def test_the_canonical_form_has_kinds_only() -> None:
    value: Any = canonical("probe", good("probe"), SCHEMAS)
    assert "hostname" not in value and "timestamp" not in value
    assert "kernel" not in value["platform"]
    assert "duration_ms" not in value["scan_methods"][0]
    assert all("instance" not in device for device in value["devices"])
    assert value["devices"][0]["raw_descriptor"] == PROBE["devices"][0]["raw_descriptor"]


def test_two_hosts_with_the_same_devices_agree() -> None:
    other = good("probe")
    other.update(hostname="elsewhere", timestamp="2027-01-01T00:00:00Z")
    other["devices"][0]["instance"]["serial"] = "ZZ99"
    del other["devices"][3]["instance"]
    assert output_digest("probe", other, SCHEMAS) == output_digest("probe", good("probe"), SCHEMAS)
    other["devices"][0]["name"] = "Acme Deskcam 2"
    assert output_digest("probe", other, SCHEMAS) != output_digest("probe", good("probe"), SCHEMAS)


def test_capability_parameters_are_no_instances_whatever_their_names() -> None:
    value = good("identify")
    value["devices"][0]["capabilities"][0]["parameters"] = {"instance": 1, "hostname": "x", "timestamp": "y"}
    assert canonical("identify", value, SCHEMAS) == value


def test_serve_is_digested_as_its_text() -> None:
    assert output_digest("serve", "a = 1\n", SCHEMAS) != output_digest("serve", "a = 2\n", SCHEMAS)


def test_serial_address_and_host_name_are_hidden_everywhere() -> None:
    probe = good("probe")
    probe["devices"][0]["instance"]["paths"] = ["/sys/devices/usb1/1-1/AC00451177/video0"]
    probe["devices"][0]["instance"]["nodes"].append(
        {"class": "video4linux", "name": "by-id", "node": "/dev/v4l/by-id/usb-Acme_ac00451177-index0"}
    )
    probe["devices"][3]["raw_descriptor"] += "\nname: wlx02005e100001\nseen: 02-00-5E-10-00-01 by bench-seven, once"
    probe["devices"][4]["name"] = "router 0a:1b:2c:3d:4e:5f"
    text = json.dumps(pseudonymise(probe, KEY)).casefold()
    for secret in ("ac00451177", "02005e100001", "02:00:5e", "02-00-5e", "bench-seven", "0a:1b:2c"):
        assert secret not in text
    assert text.count("redacted-") == 9


def test_a_short_host_name_is_hidden_as_a_word_and_spared_as_a_word_of_a_device() -> None:
    probe = good("probe")
    probe["hostname"] = "pi4"
    probe["scan_methods"][0]["detail"] = "asked pi4.local and PI4; spi4 was not"
    probe["devices"][4]["raw_descriptor"] = "arp; answers pi4"
    shown = pseudonymise(probe, KEY)
    assert shown["hostname"].startswith("redacted-")
    assert shown["scan_methods"][0]["detail"] == "asked {0}.local and {0}; spi4 was not".format(shown["hostname"])
    assert shown["devices"][4]["raw_descriptor"] == f"arp; answers {shown['hostname']}"
    probe["devices"][0]["name"] = "Acme Pi4 Deskcam"
    shown = pseudonymise(probe, KEY)
    assert shown["devices"][0]["name"] == "Acme Pi4 Deskcam"
    assert shown["devices"][4]["raw_descriptor"] == "arp; answers pi4"


def test_a_host_that_shows_no_name_has_none_to_hide() -> None:
    probe = good("probe")
    probe["hostname"] = "unknown"
    probe["scan_methods"][0]["detail"] = "the state is unknown"
    shown = pseudonymise(probe, KEY)
    assert (shown["hostname"], shown["scan_methods"][0]["detail"]) == ("unknown", "the state is unknown")


def test_the_same_secret_has_the_same_pseudonym_and_another_key_another() -> None:
    probe = good("probe")
    probe["devices"][3]["instance"]["serial"] = "ac00451177"
    hidden = pseudonymise(probe, KEY)["devices"]
    assert hidden[0]["instance"]["serial"] == hidden[3]["instance"]["serial"]
    assert hidden[0]["instance"]["serial"] != pseudonymise(probe, b"other")["devices"][0]["instance"]["serial"]


def test_the_real_values_stay_in_the_instances() -> None:
    probe = good("probe")
    before = copy.deepcopy(probe)
    pseudonymise(probe, KEY)
    assert probe == before
    assert instances(probe)["usb-1234-0001"]["serial"] == "AC00451177"
    assert set(instances(probe)) == {"usb-1234-0001", "usb-1234-0003"}


def test_hiding_does_not_touch_kinds() -> None:
    probe = good("probe")
    probe["hostname"] = "debian"
    probe["platform"]["os_id"] = "debian"
    probe["devices"][0]["raw_descriptor"] += "\nmodalias: of:debian,widget v00000000p0000"
    probe["devices"][0]["instance"]["serial"] = "Acme Deskcam"
    probe["devices"][3]["instance"]["serial"] = "00000000"
    hidden = pseudonymise(probe, KEY)
    assert hidden["hostname"].startswith("redacted-")
    assert hidden["devices"][0]["instance"]["serial"].startswith("redacted-")
    assert canonical("probe", hidden, SCHEMAS) == canonical("probe", probe, SCHEMAS)


def test_a_good_probe_has_the_same_digest_hidden_or_not() -> None:
    probe = good("probe")
    assert output_digest("probe", pseudonymise(probe, KEY), SCHEMAS) == output_digest("probe", probe, SCHEMAS)


_WORD = st.text(alphabet="abAB019:-_ redacted\u00e9\ud800", max_size=14)
_DEVICE = st.fixed_dictionaries(
    {
        "id": _WORD,
        "name": _WORD,
        "raw_descriptor": st.lists(_WORD, max_size=4).map("\n".join),
        "instance": st.dictionaries(st.sampled_from(["serial", "address", "uuid", "port", "note"]), _WORD),
    }
)
_PROBES = st.fixed_dictionaries(
    {"platform": st.just({"os": "linux"}), "hostname": _WORD, "devices": st.lists(_DEVICE, max_size=3)}
)


@given(_PROBES)
def test_hiding_twice_is_hiding_once(probe: dict[str, Any]) -> None:
    once = pseudonymise(probe, KEY)
    assert pseudonymise(once, KEY) == once
    for device, hidden in zip(probe["devices"], once["devices"], strict=True):
        serial = device["instance"].get("serial", "").strip()
        if len(serial) >= 6 and len(set(serial)) > 2 and any(item.isdigit() for item in serial):
            assert serial not in hidden["raw_descriptor"] or "redacted" in serial


@given(
    st.recursive(
        st.none() | st.integers() | st.text(),
        lambda x: (
            st.lists(x)
            | st.dictionaries(
                st.sampled_from(
                    ["devices", "instance", "hostname", "timestamp", "platform", "kernel", "id", "scan_methods"]
                ),
                x,
            )
        ),
    )
)
def test_the_canonical_form_is_its_own(value: object) -> None:
    for stage in ("probe", "identify", "interface", "deploy"):
        once = canonical(stage, value, SCHEMAS)
        assert canonical(stage, once, SCHEMAS) == once
