"""IDENTIFY of the embedded agent: what each device of the PROBE artifact is, on evidence only.

`stage.run(task)` reads that artifact (and the host's own id databases), asks one small module per device class, and
writes the annotation. No module names a product or an id: products are named by the device's own strings, by the
kernel's strings and by the host's databases.
"""

from octoform.builtin.identify.stage import run

__all__ = ["run"]
