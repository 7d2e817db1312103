"""IDENTIFY of an agent that gets it wrong: each attempt is refused, with a finding that names the right value.

The output that is changed is the embedded agent's own, about the bench of `lab` and what `shop` adds to it.
"""

import copy
from typing import Any

import pytest
from bench_host import shop
from cases import for_each
from held import Change, Output, both, probed, refusals

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.probe import probe_root

pytestmark = pytest.mark.dear

CAMERA, PANEL, SENSOR, RELAY = "usb-1f00-00c1", "hid-1f00-0078", "hwmon-benchtemp", "usb-1f00-00e1"
DISK, DISK_OF_TWO, METER, LINE, STICK = (
    "pci-1f00-5017",
    "pci-1f00-5018",
    "usb-1f00-00f1",
    "usb-1f00-00f2",
    "usb-1f00-00d1",
)


def device(value: Output, name: str) -> Output:
    return next(each for each in value["devices"] if each["id"] == name)


def named(name: str, called: str, method: str = "descriptor_strings", *evidence: str, **more: Any) -> Change:
    """An annotation that claims this name, on quotes that may be followed by ' => ' and what they say."""

    def change(value: Output) -> None:
        cited = [
            {"quote": quote, **({"says": says} if says else {})}
            for quote, _, says in (each.partition(" => ") for each in evidence)
        ]
        known = {"identified_as": called, "method": method, "confidence": 0.8}
        given = device(value, name)
        if given["category"] == "unknown":
            given.update(category="infrastructure", missing=None)
        given.update({**known, **({"evidence": cited} if cited else {}), **more})

    return change


def able(name: str, capability: str, **more: Any) -> Change:
    """A device that is said to have one capability, and to be something that acts or senses."""

    def change(value: Output) -> None:
        own = {"description": "What it does.", "via": "a library of the system", "effect": "read", **more}
        given = device(value, name)
        own = {key: text for key, text in own.items() if text is not None}
        given["capabilities"] = [{"name": capability, **own}]
        if given["category"] == "unknown":
            line = given["evidence"][0]["quote"]
            given.update(
                missing=None,
                category="bidirectional",
                confidence=0.49,
                method="descriptor_strings",
                evidence=[{"quote": line}],
            )

    return change


def dropped(name: str) -> Change:
    return lambda value: value["devices"].remove(device(value, name))


def doubled(value: Output) -> None:
    value["devices"].append(copy.deepcopy(device(value, CAMERA)))


def invented(value: Output) -> None:
    value["devices"].append({**copy.deepcopy(device(value, CAMERA)), "id": "usb-1f00-0a12"})


NAME, WAY, PIPE = "IDENTIFY-NAME-WITHOUT-EVIDENCE", "IDENTIFY-CAPABILITY-WITHOUT-CLASS", "IDENTIFY-PASSTHROUGH"
MOVES, CHIP = "IDENTIFY-ACTUATE-WITHOUT-PROFILE", "IDENTIFY-CHIP-NOT-PRODUCT"
MAX_FINDINGS = 2
"""A guess that moves something is reported as both, since both have to go."""
CAM = "product: Bench Cam <serial>"
WRONG: dict[str, tuple[Change, str, str]] = {
    # Names: the finding has the word without a source, and beside it the device's own strings.
    "a part of a longer word": (
        named(METER, "Bench Charm", "descriptor_strings", "product: Bench Charmeter"),
        NAME,
        "Charm",
    ),
    "another kind of thing, by one word in common": (
        named(PANEL, "Robot arm", "kernel_class", "input[0].name: BENCH:ARM-M4 1F00:0078"),
        NAME,
        "Robot",
    ),
    "another maker": (named(CAMERA, "Zebra Works Cam", "descriptor_strings", CAM), NAME, "Zebra"),
    "another model": (
        named(CAMERA, "Bench Works Cam 2", "descriptor_strings", CAM, "manufacturer: Bench Works"),
        NAME,
        "'2'",
    ),
    "a model from what is said": (
        named(CAMERA, "Bench Cam HX20", "kernel_class", f"{CAM} => a HX20 is bound by this driver"),
        NAME,
        "HX20",
    ),
    "a maker from what is said": (
        named(CAMERA, "Logimax Bench Cam", "descriptor_driver", f"{CAM} => Logimax makes it"),
        NAME,
        "Logimax",
    ),
    "a maker that no quote says": (
        named(CAMERA, "Bench Works Cam", "descriptor_strings", CAM),
        NAME,
        "manufacturer: Bench Works",
    ),
    "the words of a key": (
        named(METER, "product vendor 00f1", "descriptor_strings", "product: Bench Charmeter"),
        NAME,
        "00f1",
    ),
    "memory in the place of a database": (
        named(CAMERA, "Zebra Eye", "id_database", "product_id: 00c1 => usb.ids: Zebra Eye"),
        NAME,
        "Bench Electronics",
    ),
    "another entry of the database": (
        named(RELAY, "Bench Electronics Dimmer", "id_database", "product_id: 00e1 => usb.ids: Dimmer"),
        NAME,
        "Relay Board",
    ),
    "one model of an entry that names several": (
        named(DISK_OF_TWO, "Bench Electronics SN1", "id_database", "device_id: 5018 => pci.ids: Desk SN1"),
        NAME,
        "SN1",
    ),
    "another model than the recorded one": (
        named(DISK, "BE SN770 NVMe SSD", "id_database", "nvme[0].model: BE SN740 512GB => pci.ids: SN770"),
        NAME,
        "SN770",
    ),
    "a page without an address": (
        named(METER, "Bench Charmeter Pro", "web_search", "product: Bench Charmeter => found on the web: Pro"),
        NAME,
        "Pro",
    ),
    "a page that speaks of no quoted word": (
        named(STICK, "Wonder Widget", "web_search", "bus: usb => example.org/widgets says Wonder Widget"),
        NAME,
        "Wonder",
    ),
    "a kind of thing at the end of a raw line": (
        named(
            LINE,
            "Thermometer",
            "kernel_class",
            "tty[0].name: ttyUSB => a serial thermometer",
            category="sensor",
            capabilities=[],
            missing=None,
        ),
        NAME,
        "Thermometer",
    ),
    "two products in one name": (
        named(RELAY, "Bench Relay and Charmeter", "descriptor_strings", "product: Bench Relay"),
        NAME,
        "Charmeter",
    ),
    "a name of another script that nothing says": (
        named(CAMERA, "Камера Зебра", "descriptor_strings", CAM),
        NAME,
        "Зебра",
    ),
    "a quote of another device": (
        named(CAMERA, "Bench Relay", "descriptor_strings", "product: Bench Relay"),
        "IDENTIFY-QUOTE-NOT-VERBATIM",
        "letter by",
    ),
    "a quote from memory": (
        named(CAMERA, "Bench Cam", "descriptor_strings", "product: Bench Cam Pro"),
        "IDENTIFY-QUOTE-NOT-VERBATIM",
        "copy it",
    ),
    "a profile that no one has": (
        named(RELAY, "Bench Relay", "profile", "product: Bench Relay", profile="relay"),
        "IDENTIFY-PROFILE-EVIDENCE",
        "relay",
    ),
    # Chips.
    "a chip for a product": (
        named(LINE, "USB-serial adapter", "descriptor_strings", "product: USB Serial", category="sensor", missing=None),
        CHIP,
        "unknown",
    ),
    "a chip with a reading": (
        both(
            able(LINE, "read_level"),
            named(LINE, "USB-serial adapter", "descriptor_strings", "product: USB Serial", category="infrastructure"),
        ),
        CHIP,
        "without capabilities",
    ),
    "an unknown chip that can do something": (
        lambda value: device(value, LINE).update(capabilities=device(value, CAMERA)["capabilities"]),
        "IDENTIFY-UNKNOWN-CAPABILITY",
        "leave capabilities empty",
    ),
    "an unknown device that is half known": (
        lambda value: device(value, METER).update(confidence=0.4),
        "IDENTIFY-UNKNOWN-CONFIDENCE",
        "0.0",
    ),
    "an unknown device without a question": (
        lambda value: device(value, METER).update(missing="?"),
        "IDENTIFY-UNKNOWN-MISSING",
        "settle it",
    ),
    # Capabilities.
    "a picture from a thermometer": (able(SENSOR, "capture_image"), WAY, "video4linux"),
    "sound from a camera": (able(CAMERA, "record_audio"), WAY, "sound"),
    "a disk behind a touch panel": (able(PANEL, "read_disk_health"), WAY, "block"),
    "a reading without any class": (able(METER, "read_charm"), WAY, f"octoform profile new {METER}"),
    "an erasure for a reading": (able(CAMERA, "erase_pictures"), "IDENTIFY-EFFECT-UNDERSTATED", "irreversible"),
    "an erasure in the description": (
        able(CAMERA, "capture_image", description="Delete the old picture, take a new one."),
        "IDENTIFY-EFFECT-UNDERSTATED",
        "irreversible",
    ),
    "a setting for a reading": (able(CAMERA, "set_exposure"), "IDENTIFY-EFFECT-UNDERSTATED", "actuate"),
    "a pipe that queries": (able(RELAY, "query_device"), PIPE, "typed parameters"),
    "a pipe that exchanges": (able(RELAY, "exchange_message"), PIPE, "typed parameters"),
    "a pipe to registers": (able(RELAY, "register_access"), PIPE, "typed parameters"),
    "a pipe by its description": (
        able(RELAY, "read_state", description="Sends any command and reads what comes back."),
        PIPE,
        "description",
    ),
    "a pipe by what it takes": (able(RELAY, "read_state", parameters={"payload": "hex string"}), PIPE, "parameters"),
    "a way that is none": (able(CAMERA, "capture_image", via="n/a"), "IDENTIFY-NO-VIA", "infrastructure"),
    # What moves.
    "a guess that moves a joint": (
        both(able(LINE, "move_joint", effect="actuate"), named(LINE, "desk arm", confidence=0.49)),
        MOVES,
        f"octoform profile new {LINE}",
    ),
    "a relay from memory": (able(RELAY, "switch_relay", effect="actuate"), MOVES, "how to stop"),
    "an action without any class": (able(METER, "start_motor", effect="irreversible"), MOVES, "profile new"),
    "infrastructure that acts": (
        able(DISK, "eject_disk", effect="actuate"),
        "IDENTIFY-INFRASTRUCTURE-ACTUATES",
        "drop the capability",
    ),
    "one name with two effects": (
        both(able(CAMERA, "read_level"), able(PANEL, "read_level", effect="actuate")),
        "IDENTIFY-EFFECT-CONFLICT",
        "different",
    ),
    # Devices.
    "a device that PROBE does not know": (invented, "IDENTIFY-INVENTED-DEVICE", "usb-1f00-0a12"),
    "one device twice": (doubled, "IDENTIFY-DUPLICATE-DEVICE", "once"),
    "a device in silence": (dropped(PANEL), "IDENTIFY-DEVICE-UNACCOUNTED", PANEL),
}


def allowed(value: Output) -> None:
    """What an agent may do, once in each way, on the same host."""
    for change in (
        named(CAMERA, "Bench Works cameras", "descriptor_strings", CAM, "manufacturer: Bench Works"),
        named(PANEL, "Touch panel ARM-M4", "kernel_class", "input[0].name: BENCH:ARM-M4 1F00:0078 => a touch panel"),
        named(
            DISK,
            "BE SN740 512GB solid-state disk",
            "kernel_class",
            "nvme[0].model: BE SN740 512GB => a solid-state disk",
        ),
        named(
            DISK_OF_TWO, "Bench Electronics NVMe SSD", "id_database", "device_id: 5018 => pci.ids: Desk SN1 / Desk SN2"
        ),
        named(
            METER,
            "Bench Charmeter Pro",
            "web_search",
            "product: Bench Charmeter => example.org/charmeter: the Pro",
            category="infrastructure",
            missing=None,
            confidence=0.6,
        ),
        named(RELAY, "Bench Electronics Relay Board", "id_database", "product: Bench Relay => usb.ids"),
        able(RELAY, "read_relay_state"),
    ):
        change(value)


@pytest.fixture(scope="module")
def refused(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """The errors of each case of `WRONG`; after them `allowed` is accepted."""
    folder = tmp_path_factory.mktemp("held")
    host = shop(folder / "host")
    probe = probe_root(host)
    changes = [*(change for change, _, _ in WRONG.values()), allowed]
    good = identify(probe, IdDatabases(host))
    _, errors = refusals(folder, host, "identify", {"probe": probe}, good, changes, known=probed(host, probe))
    return dict(zip(WRONG, errors, strict=True))


@for_each("case", WRONG, every=3, kind=lambda case: WRONG[case][1])
def test_what_the_evidence_does_not_bear_out_is_refused_with_the_cure(
    refused: dict[str, dict[str, str]], case: str
) -> None:
    _, code, result = WRONG[case]
    found = refused[case]
    assert code in found and len(found) <= MAX_FINDINGS and result in found[code], found
