"""When a name rests on what is cited for it, method by method."""

import pytest
from contract_samples import SCHEMAS, artifacts, good

from octoform.contracts.checking import check

CODE = "IDENTIFY-NAME-WITHOUT-EVIDENCE"


@pytest.mark.parametrize(
    ("name", "method", "confidence", "says", "accepted"),
    [
        ("Acme Desk Cam 2", "descriptor_strings", 0.9, "", True),
        ("Roboarm Deluxe", "descriptor_strings", 0.9, "a Roboarm", False),
        ("Roboarm Deluxe", "descriptor_strings", 0.45, "", True),
        ("Roboarm Deluxe", "id_database", 0.9, "usb.ids: Roboarm", True),
        ("Roboarm Deluxe", "web_search", 0.9, " ", False),
        ("Roboarm Deluxe", "kernel_class", 0.9, "a roboarm is bound", True),
        ("Roboarm Deluxe", "descriptor_driver", 0.9, "a camera", False),
        ("Roboarm Deluxe", "none", 0.9, "", False),
        ("product driver", "descriptor_strings", 0.9, "", False),
        ("USB device", "descriptor_driver", 0.9, "", True),
    ],
)
def test_a_name_shares_a_word_with_what_is_cited(
    name: str, method: str, confidence: float, says: str, accepted: bool
) -> None:
    value = good("identify")
    evidence = [{"quote": "product: Acme Deskcam", **({"says": says} if says else {})}]
    value["devices"][0] |= {
        "identified_as": name, "method": method, "confidence": confidence, "evidence": evidence,
    }  # fmt: skip
    found = [item.code for item in check("identify", value, artifacts(), SCHEMAS)]
    assert found == ([] if accepted else [CODE])
