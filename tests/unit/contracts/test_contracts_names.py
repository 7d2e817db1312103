"""When a name rests on what is cited for it: forms that a person would write, method by method, and their opposites."""

import pytest
from unit.contracts.contract_samples import SCHEMAS, artifacts, good

from octoform.contracts.contract_check import check
from octoform.diagnostics import Diagnostic

CODE = "IDENTIFY-NAME-WITHOUT-EVIDENCE"
ENTRY = "Acme Imaging DeskCam 300 / DeskCam 310 / DeskCam Pro"
TEXT = """bus: usb
manufacturer: Acme Imaging
product: Acme QuickCam-Pro 300s
video4linux[0].name: ＡＣＭＥ Quick Cam
interface 00: label=Kamera für Lötplätze
udev.ID_MODEL: カメラ
driver: uvcvideo"""

RIGHT = [
    ("Acme QuickCam Pro 300s", "descriptor_strings", ["product: Acme QuickCam-Pro 300s"]),
    ("Acme Quick Cam", "descriptor_strings", ["product: Acme QuickCam-Pro 300s"]),
    ("QuickCam-Pro 300s by Acme Imaging", "descriptor_strings", ["product: Acme QuickCam-Pro 300s", "Acme Imaging"]),
    ("acme quickcam pro", "descriptor_strings", ["product: Acme QuickCam-Pro 300s"]),
    ("QUICKCAM PRO", "descriptor_strings", ["QuickCam-Pro"]),
    ("Acme Imaging cameras", "descriptor_strings", ["manufacturer: Acme Imaging"]),
    ("Acme Quick-Cams", "kernel_class", ["video4linux[0].name: ＡＣＭＥ Quick Cam"]),
    ("Camera for soldering places", "kernel_class", ["label=Kamera für Lötplätze => a camera for soldering places"]),
    ("Kamera für Lötplätze", "descriptor_strings", ["label=Kamera für Lötplätze"]),
    ("カメラ", "descriptor_strings", ["udev.ID_MODEL: カメラ"]),
    ("USB video camera", "kernel_class", ["driver: uvcvideo => the driver of cameras"]),
    ("camera of the uvcvideo class", "descriptor_driver", ["driver: uvcvideo"]),
    ("rear webcam with microphone", "kernel_class", ["driver: uvcvideo => a webcam"]),
    ("Acme Imaging DeskCam", "id_database", ["bus: usb => usb.ids: DeskCam 300 / DeskCam 310"]),
    (ENTRY, "id_database", ["bus: usb => usb.ids"]),
    ("Acme DeskCam QuickCam-Pro 300s", "id_database", ["product: Acme QuickCam-Pro 300s => usb.ids: DeskCam"]),
    ("Acme Vision 7", "web_search", ["manufacturer: Acme Imaging => acme.example/v7: the Acme Imaging Vision 7"]),
    ("Acme Vision 7", "web_search", ["manufacturer: Acme => acme.example/v7: the Acme Vision 7"]),
    ("anything at all", "user_answer", ["driver: uvcvideo"]),
]
WRONG = [
    ("Roboarm Deluxe", "descriptor_strings", ["product: Acme QuickCam-Pro 300s => a Roboarm Deluxe"]),
    ("Acme QuickCam-Pro 310s", "descriptor_strings", ["product: Acme QuickCam-Pro 300s"]),
    ("Acme QuickCam 2", "descriptor_strings", ["product: Acme QuickCam-Pro 300s"]),
    ("Acme Quick", "descriptor_driver", ["driver: uvcvideo => an Acme"]),
    ("Acme DeskCam 310", "id_database", ["bus: usb => usb.ids: DeskCam 310"]),
    ("Zebra DeskCam", "id_database", ["bus: usb => usb.ids: Zebra DeskCam"]),
    ("Acme Vision 7", "web_search", ["manufacturer: Acme Imaging => somewhere on the web"]),
    ("Vision 7", "web_search", ["bus: usb => vision.example: Vision 7"]),
    ("Roboarm", "none", ["driver: uvcvideo"]),
]


# What the finding proposes for such a name, method by method.
CURES = {
    "descriptor_strings": "quote the string that holds it",
    "descriptor_driver": "quote the line that has it",
    "kernel_class": "quote the line that has it",
    "id_database": "name what the entry names",
    "web_search": "the page's address",
    "user_answer": "the owner's words",
}


def found(name: str, method: str, cited: list[str], confidence: float) -> list[str]:
    """The codes of `findings`."""
    return [item.code for item in findings(name, method, cited, confidence)]


def findings(name: str, method: str, cited: list[str], confidence: float) -> list[Diagnostic]:
    """What is wrong with a camera of that name, on quotes that may be followed by ' => ' and what they say."""
    value, probe = good("identify"), good("probe")
    probe["devices"][0] |= {"raw_descriptor": TEXT}
    evidence = [{"quote": quote, **({"says": says} if says else {})}
                for quote, _, says in (each.partition(" => ") for each in cited)]  # fmt: skip
    camera = value["devices"][0]
    camera |= {"identified_as": name, "method": method, "confidence": confidence, "evidence": evidence}
    known = artifacts(probe=probe, registered={camera["id"]: ENTRY}, answers={camera["id"]: "anything at all"})
    errors = check("identify", value, known, SCHEMAS)
    return [item for item in errors if (item.pointer or "").startswith("/devices/0/ident")]


@pytest.mark.parametrize(("name", "method", "cited"), RIGHT)
def test_a_name_whose_words_are_cited_is_accepted_in_any_form(name: str, method: str, cited: list[str]) -> None:
    assert found(name, method, cited, 0.9) == []


@pytest.mark.parametrize(("name", "method", "cited"), WRONG)
def test_a_name_with_a_word_of_its_own_is_refused_and_may_be_guessed(name: str, method: str, cited: list[str]) -> None:
    assert found(name, method, cited, 0.5) == [CODE]
    assert found(name, method, cited, 0.49) == []


@pytest.mark.parametrize("method", CURES)
def test_a_refused_name_gets_the_cure_of_its_method(method: str) -> None:
    (finding,) = findings("Zebra 9000", method, ["driver: uvcvideo"], 0.9)
    assert finding.code == CODE and CURES[method] in (finding.hint or "")
