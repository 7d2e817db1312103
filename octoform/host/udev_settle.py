"""Whether the system still takes in what was plugged: drivers are loaded after the kernel announced a device. (Light.)

Whoever looks at the hardware in between sees half of it, and then sees that it changed once more. udev tells by a file
whether it has something to do (libudev, udev_queue_get_udev_is_active). While a driver speaks with its new device udev
has nothing to do either, so only a second without work counts.
"""

import time
from collections.abc import Callable
from pathlib import Path

UDEV, QUEUE = "run/udev", "run/udev/queue"
SETTLE_SECONDS, QUIET_SECONDS = 10.0, 1.0
_PAUSE = 0.1


def settle(root: Path, pause: Callable[[float], object] = time.sleep) -> bool:
    """Wait until udev has had nothing to do for QUIET_SECONDS, at most SETTLE_SECONDS; whether that is so.

    Where there is no udev nothing is waited for.
    """
    quiet = 0
    for _ in range(round(SETTLE_SECONDS / _PAUSE)):
        quiet = 0 if (root / QUEUE).exists() else quiet + 1
        if quiet > QUIET_SECONDS / _PAUSE or not (root / UDEV).is_dir():
            return True
        pause(_PAUSE)
    return False
