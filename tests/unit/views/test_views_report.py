"""Coverage as a person, a program and a reader of the page see it; and nothing in it acts or gives this host away."""

import io
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from covered import declared, identified, known, left, onboarded, report, seen
from hostile_strings import STRINGS
from hosts.plant import plant

from octoform.base.escaping import is_hidden
from octoform.engine.coverage import CoverageReport
from octoform.engine.coverage_runs import run_of
from octoform.views import coverage as coverage_view
from octoform.views.coverage import page
from octoform.views.format.console import Console

SECRETS = ("heron", "KO-200417", "BATT-00417", "RNV-0001733", "MC-INVENTED-77", "02:00:5e", "192.0.2.1", "/dev/")
VOID = {"meta", "br"}


@pytest.fixture(scope="module")
def laptop(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return onboarded(plant("laptop", tmp_path_factory.mktemp("hosts") / "laptop"))


def plain(text: str, *_: str) -> str:
    return text


def lines(made: CoverageReport, width: int = 80, **more: Any) -> list[str]:
    return list(coverage_view.lines(made, width, plain, **more))


def sample(name: str = "Some Device", detail: str = "nothing drives it", **more: Any) -> CoverageReport:
    """A report that has one of everything, every foreign text of it ``name``."""
    ids = ("camera", "relay", "mystery", "hub", "chip")
    identify = identified(
        [
            known("camera", "sensor", "capture_image", identified_as=name, profile=name),
            known("relay", "actuator", identified_as=name),
            known("mystery", "unknown", identified_as=name, confidence=0.0, missing=f"What is {name}?"),
        ],
        [left("hub", "virtual", detail), left("chip", "no_standard_interface", detail)],
    )
    probe = {"platform": {"os": name, "arch": name}, "devices": [seen(one, name) for one in ids]}
    artifacts = {"probe": probe, "identify": identify, "interface": declared(identify)}
    other = identified([{**known("camera", "sensor", "capture_image"), "identified_as": f"not {name}"}])
    runs = [run_of("pi", one, declared(one)) for one in (identify, other)]
    return report(artifacts, runs, tiers={"camera": 1, "relay": 2, "mystery": 1}, **more)


class Shape(HTMLParser):
    """Elements of a page, checked to be closed in order, and the values of its attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: list[str] = []
        self.open: list[str] = []
        self.attributes: set[str] = set()
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.append(tag)
        self.attributes.update(name for name, _ in attrs)
        self.open += [] if tag in VOID else [tag]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("width", [60, 80, 120, 140])
def test_no_line_is_wider_than_the_terminal(laptop: dict[str, Any], width: int) -> None:
    for made in (report(laptop), sample("a name of some length " * 12)):
        found = lines(made, width, everything=False)
        assert [line for line in found if len(line) > width] == []


def test_every_device_that_is_not_left_out_is_shown_and_all_of_them_with_all(laptop: dict[str, Any]) -> None:
    text, everything = "\n".join(lines(report(laptop))), "\n".join(lines(report(laptop), everything=True))
    for device in laptop["identify"]["devices"]:
        assert device["id"] in text
    for device in laptop["probe"]["devices"]:
        assert device["id"] in everything


def test_a_person_reads_funnel_figures_reasons_and_the_question() -> None:
    text = "\n".join(lines(sample(denied=frozenset({"capture_image"})), 100))
    for words in (
        "  discovered      5  ████",
        "    25 %  1 of 4 eligible devices are usable",
        "camera  Some Device (thing, no input, 0.8 by kernel_class Some Device)",
        "What is Some Device?",
        'octoform answer mystery "..."',
        "no library or system interface reaches it (no_standard_interface; eligible)",
        "identity over 2 runs (pi)",
        'camera: identity: "Some Device" in 1 run, "not Some Device" in 1',
        "1 tool denied to everybody by the policy: capture_image",
        "all                        3        0  0.6 s",
    ):
        assert words in text, words


def test_bars_of_a_terminal_without_the_sign_are_of_another(laptop: dict[str, Any]) -> None:
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="backslashreplace")
    console = Console(out, out, False, False, False)
    assert coverage_view.show(console, report(laptop), everything=False, as_json=False) == 0
    out.seek(0)
    found = out.read()
    assert "####" in found and "\\u2588" not in found


def test_json_has_every_device_with_the_same_members(laptop: dict[str, Any]) -> None:
    out = io.StringIO()
    console = Console(out, out, False, False, False)
    assert coverage_view.show(console, report(laptop), everything=False, as_json=True) == 0
    document = json.loads(out.getvalue())
    assert document["format"] == 1
    assert [item["id"] for item in document["devices"]] == [item["id"] for item in laptop["probe"]["devices"]]
    assert {frozenset(item) for item in document["devices"]} == {
        frozenset(
            {
                *("id", "seen_as", "bus", "standing", "counted", "identified_as", "category", "class", "confidence"),
                *("method", "profile", "tier", "answered", "capabilities", "tools", "reason", "detail", "question"),
                "offer",
            }
        )
    }
    assert document["funnel"]["enumerated"] == len(document["devices"])
    assert sum(document["left_out"].values()) + document["funnel"]["annotated"] == document["funnel"]["enumerated"]
    share = document["coverage"]["onboardable"]
    counted = [item for item in document["devices"] if item["counted"] == "onboardable"]
    assert (share["of"], share["usable"]) == (len(counted), sum(1 for item in counted if item["tools"]))
    assert set(document["runs"][0]) >= {
        "attempts",
        "retries",
        "seconds",
        "tools",
        "enumerated",
        "annotated",
        "cost_usd",
    }


def test_nothing_of_this_one_host_is_shown(laptop: dict[str, Any]) -> None:
    made = report(laptop)
    items = [page(made), "\n".join(lines(made, 140, everything=True)), json.dumps(coverage_view.as_document(made))]
    for text in items:
        assert [secret for secret in SECRETS if secret in text.replace("Heron", "")] == []


def test_the_page_loads_nothing_and_runs_nothing(laptop: dict[str, Any]) -> None:
    text = page(report(laptop))
    shape = Shape(text)
    assert not {"script", "link", "img", "iframe", "object", "form", "a"} & set(shape.names)
    assert not {"src", "href", "onload", "onclick"} & shape.attributes
    assert re.search(r"https?:|url\(|@import", text) is None
    assert "default-src 'none'" in text


@pytest.mark.parametrize(
    "name",
    [
        "<script>alert(1)</script>",
        '"><img src=x onerror=alert(1)>',
        "' onmouseover='alert(1)",
        "a &amp; <b>",
        "\u202eevil\u2066",
        "שלום עולם",
        "{{ 7 * 7 }}{% raw %}",
        "x" * 300,
        "</style><style>*{display:none}",
        "\ud800 lone",
        *(item.text for item in STRINGS[:40]),
    ],
)
def test_a_device_may_call_itself_anything(name: str) -> None:
    made, harmless = sample(name, name), sample()
    text = page(made)
    shape, expected = Shape(text), Shape(page(harmless))
    assert sorted(shape.names) == sorted(expected.names)
    assert shape.attributes == expected.attributes
    for shown in (text, *lines(made, 100, everything=True)):
        assert [sign for sign in shown if is_hidden(sign) and sign != "\n"] == []
    out = io.StringIO()
    coverage_view.show(Console(out, out, False, False, False), made, everything=False, as_json=True)
    assert [sign for sign in out.getvalue() if is_hidden(sign) and sign != "\n"] == []
    out.getvalue().encode()
    text.encode()


def test_a_partial_report_says_what_is_not_known(laptop: dict[str, Any]) -> None:
    made = report({"probe": laptop["probe"]}, runs=[run_of("builtin", laptop["identify"], None)])
    text = "\n".join(lines(made))
    assert "identified  not known yet" in text
    assert "seen, not identified yet (25)" in text
    assert "eligible" not in text
    assert "Not known before INTERFACE has decided the tools." in page(made)


def test_a_page_is_written_where_it_was_asked_for(tmp_path: Path) -> None:
    out = io.StringIO()
    console = Console(out, out, False, False, False)
    assert coverage_view.written(console, tmp_path / "page.html", as_json=False) == 0
    assert out.getvalue().startswith("Wrote ")
