"""Whether the system still takes in what was plugged: drivers are loaded after the kernel announced a device. (Light.)

Whoever looks at the hardware in between sees half of it, and then sees that it changed once more. udev tells by a file
whether it has something to do (libudev, udev_queue_get_udev_is_active).
"""

import time
from collections.abc import Callable
from pathlib import Path

QUEUE = "run/udev/queue"
SETTLE_SECONDS = 10.0
_PAUSE = 0.1


def settle(root: Path, pause: Callable[[float], object] = time.sleep) -> bool:
    """Wait until udev has nothing more to do, at most SETTLE_SECONDS; whether that is so.

    Where no udev is at work nothing is waited for.
    """
    for _ in range(round(SETTLE_SECONDS / _PAUSE)):
        if not (root / QUEUE).exists():
            return True
        pause(_PAUSE)
    return False
