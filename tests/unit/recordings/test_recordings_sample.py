"""A sample of the recordings: the same ones each time, of hosts and of devices, and all of them in the end."""

from pathlib import Path

from recordings.onboarding import is_whole_host
from recordings.run import sample

HOSTS = [Path(f"host-{number:02d}") for number in range(30)]
DEVICES = [Path(f"dev-{number:02d}") for number in range(47)]
ALL = sorted([*HOSTS, *DEVICES])


def test_a_third_is_a_third_of_hosts_and_of_devices() -> None:
    taken = sample(ALL, 3)
    assert len([folder for folder in taken if is_whole_host(folder.name)]) == 10
    assert len([folder for folder in taken if not is_whole_host(folder.name)]) == 16
    assert taken == sample(list(reversed(ALL)), 3)
    assert taken != sorted([*HOSTS[::3], *DEVICES[::3]]), "neighbours do not stand and fall together"


def test_no_sample_is_all_and_of_one_there_is_always_one() -> None:
    assert sample(ALL, 1) == ALL
    assert sample(HOSTS[:1], 100) == HOSTS[:1]
