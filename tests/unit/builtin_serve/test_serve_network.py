"""Network and Bluetooth adapters through the generated server: what the kernel shows, null where it does not."""

import shutil
from pathlib import Path

from unit.builtin_serve.generated_endpoint import Endpoint
from unit.builtin_serve.invented_host import ADAPTER


def test_network_interfaces_and_radios_are_read(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("read_network_interfaces", "read_bluetooth"))
    network, radios = endpoint.data([("read_network_interfaces", {}), ("read_bluetooth", {})])
    wired, wireless = network["interfaces"]
    assert wired == {
        **{"name": "eth0", "state": "up", "carrier": True, "wireless": False, "speed_mbps": 1000, "duplex": "full"},
        **{"mtu": 1500, "received_bytes": 4100, "sent_bytes": 2050, "receive_errors": 0, "send_errors": 3},
    }
    assert wireless == {
        **dict.fromkeys(("carrier", "speed_mbps", "duplex", "mtu", "received_bytes", "sent_bytes")),
        **{"name": "wlan0", "state": "down", "wireless": True, "receive_errors": None, "send_errors": None},
    }
    radio = {"name": "hci0", "switched_off": True, "blocked_by_hardware": False, "connections": 1}
    assert radios == {"device": ADAPTER, "radios": [{**radio, "paired": ["Demo Keys", "Mine"]}]}


def test_what_only_root_may_read_is_null(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("read_bluetooth",))
    shutil.rmtree(endpoint.root / "var")
    (radios,) = endpoint.data([("read_bluetooth", {})])
    assert radios["radios"][0]["paired"] is None
