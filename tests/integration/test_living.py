"""A live endpoint with its daemon, scripted agents and a simulated rig: what is known is kept, and reported once.

Everything runs as a person has it: `octoform watch` is a process, calls are those of a client, and agents are programs
whose inputs lie in their attempts' folders.
"""

import json
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from campaign.bench import Bench
from campaign.bench import until as became
from campaign.cases_tools import broken, heal, mended, watch
from campaign.making import made

pytestmark = pytest.mark.dear

LONG = 90.0
until = partial(became, step=0.1)
TARGET = "tool:weigh"
NOTIFY = """
import json, sys
with open(sys.argv[1], "a") as file:
    file.write(json.dumps(json.load(sys.stdin)) + "\\n")
"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Iterator[Bench]:
    """One deployment for all of them; each test leaves it well."""
    found = made("scripted", tmp_path_factory.mktemp("living"), environments, loaded=True)
    alerts = found.project.outside / "alerts"
    program = json.dumps([sys.executable, "-c", NOTIFY, str(alerts)])
    found.project.manifest["daemon"] = f"{{calls_per_hour: 1000, notify: {{command: {program}}}}}"
    found.project.write()
    found.end_daemon()
    found.watch()
    yield found
    found.close()
    assert found.strangers() == []


@pytest.fixture(autouse=True)
def calm(bench: Bench) -> None:
    bench.reset()
    (bench.project.outside / "alerts").write_text("")


def alerts(bench: Bench) -> list[tuple[str, str]]:
    """The alerts that a person got, with their targets, in order."""
    lines = (bench.project.outside / "alerts").read_text().splitlines()
    return [(each["event"], each["target"]) for each in map(json.loads, lines)]


def asked(bench: Bench) -> list[str]:
    """The agents that were begun."""
    log = bench.project.outside / "repairer.log"
    return [json.loads(line)["stage"] for line in log.read_text().splitlines()] if log.exists() else []


def given(bench: Bench, stage: str) -> dict[str, Any]:
    """What the last agent of that stage was given."""
    paths = sorted(bench.layout.attempts.glob(f"*-{stage}-*/input.json"))
    return dict(json.loads(paths[-1].read_text()))


def outcome(bench: Bench, target: str = TARGET) -> str | None:
    """How the open episode of a target stands."""
    found = [each for each in bench.open_episodes() if each["target"] == target]
    assert len(found) <= 1, "one trouble, two incidents"
    return found[0]["outcome"] if found else None


def given_up(bench: Bench) -> list[str]:
    """A tool that fails and that no repair mends; the agents that were asked until it was given up."""
    before = len(asked(bench))
    broken(bench, watch=watch(), heal=heal("broken"))
    assert until(lambda: outcome(bench) == "frozen", LONG), bench.said()
    return asked(bench)[before:]


def restart(bench: Bench) -> None:
    bench.end_daemon()
    bench.watch()


def edit(bench: Bench) -> None:
    """A person edits octopus.yaml, and the daemon takes it up."""
    path = bench.project.folder / "octopus.yaml"
    path.write_text(path.read_text() + "# a word of the owner's\n")
    looked = bench.health().get("at")
    assert until(lambda: bench.health().get("at") != looked, LONG)


def doings(bench: Bench, target: str) -> list[str]:
    """The entries of the execution log for the daemon and a target."""
    log = [json.loads(line) for line in bench.layout.call_log.read_text().splitlines()]
    return [each["event"] for each in log if each.get("from") == "daemon" and each["target"] == target]


def listed(bench: Bench) -> list[str]:
    """The targets that `octoform heal` lists."""
    document = json.loads(bench.project.run("heal", "-json").out)
    return [each["target"] for value in document.values() if isinstance(value, list) for each in value]


def test_what_was_given_up_costs_nothing_more_and_stays_so_until_a_person_asks(bench: Bench) -> None:
    first = given_up(bench)
    assert first.count("heal") >= 2 and given(bench, "watch")["failures"][0]["tool"] == "weigh"
    spent = len(asked(bench))
    for again in (restart, edit):
        again(bench)
        for _ in range(3):
            assert not bench.call("weigh")[0]
        edit(bench)  # so that the daemon looks: what is as before it reports once a minute
        assert outcome(bench) == "frozen" and listed(bench) == [TARGET]
        assert not until(lambda: len(asked(bench)) != spent, 3.0), "a frozen trouble costs a run of an agent"
    assert [each for each in alerts(bench) if each[1] == TARGET] == [("opened", TARGET), ("frozen", TARGET)]

    # A person mends it while HEAL is still thinking: the call that works then is the end of the trouble.
    broken(bench, heal={**heal("broken"), "sleep": 3.0})
    bench.project.run("heal", "-retry", TARGET, status=0)
    assert until(lambda: asked(bench)[spent:].count("heal") >= 1, LONG), "no one is asked although a person wants it"
    assert until(lambda: any(bench.layout.attempts.glob("*-heal-*/input.json")), LONG)
    failures = given(bench, "heal")["failures"]
    assert [each["tool"] for each in failures] == ["weigh"] and failures[0]["count"] >= 1

    mended(bench)
    assert until(lambda: not bench.open_episodes(), LONG)
    assert listed(bench) == [], "what is over is listed"
    text = bench.project.run("heal").text
    assert TARGET not in text and "None" not in text


def test_one_replug_is_told_once_and_one_hang_is_one_trouble(bench: Bench) -> None:
    known = set(bench.episodes())
    bench.host.unplug("1-1")
    assert until(lambda: bool(set(bench.episodes()) - known), LONG)
    bench.host.camera("1-1", 0)
    assert until(lambda: not bench.open_episodes(), LONG), bench.said()
    fresh = [each for name, each in bench.episodes().items() if name not in known]
    assert len(fresh) == 1, [(each["kind"], each["summary"]) for each in fresh]
    assert len(alerts(bench)) <= 2 and {target for _, target in alerts(bench)} <= {fresh[0]["target"]}
    target = fresh[0]["target"]
    assert until(lambda: doings(bench, target)[-1] == "over", LONG), "the daemon's doings stand among the calls"
    assert doings(bench, target)[0] == "noticed"

    known = set(bench.episodes())
    for path in bench.host.tree.root.glob("sys/class/hwmon/*/temp1_input"):
        path.write_text("200000\n")
    for _ in range(2):
        assert not bench.call("wait_for_sensor")[0]
    assert until(lambda: bool(set(bench.episodes()) - known), LONG)
    for path in bench.host.tree.root.glob("sys/class/hwmon/*/temp1_input"):
        path.write_text("21500\n")
    # The last caller may have been the daemon, while the tool still hung.
    assert until(lambda: bench.call("wait_for_sensor")[0] and not bench.open_episodes(), LONG), bench.said()
    fresh = [each for name, each in bench.episodes().items() if name not in known]
    assert len(fresh) == 1, [(each["kind"], each["summary"]) for each in fresh]


def test_what_the_manifest_no_longer_wants_is_no_longer_promised(bench: Bench) -> None:
    assert until(lambda: bench.health().get("status") == "healthy", LONG), bench.health()
    project = bench.project
    project.manifest["perception"] = "{enabled: true}"
    project.write()
    assert until(lambda: bench.health().get("status") not in (None, "healthy"), LONG), "the camera gives no picture"
    del project.manifest["perception"]
    project.write()
    assert until(lambda: bench.health().get("status") == "healthy", LONG), bench.health()
    assert project.run("status").status == 0
    assert project.run("health").status == 0


def test_an_edit_that_a_person_has_adopted_is_served_and_left_alone(bench: Bench) -> None:
    known, server = set(bench.episodes()), bench.layout.output("serve")
    server.write_text(server.read_text() + "\n# a word of the owner's\n")
    # The daemon may be looking at the very file, and holds the lock meanwhile.
    assert until(lambda: bench.project.run("state", "adopt", "serve").status == 0, LONG)
    assert until(lambda: bench.project.apply().status == 0, LONG)
    assert until(lambda: bench.serves() and not bench.open_episodes(), LONG), bench.said()
    edit(bench)  # a cause to look once more
    fresh = [each for name, each in bench.episodes().items() if name not in known]
    tries = [made["repair"] for each in fresh for made in each["tries"]]
    assert tries.count("republish") <= 1 and not [each for each in fresh if each["outcome"] == "frozen"], fresh
    assert bench.call("weigh") == (True, "a cup")
