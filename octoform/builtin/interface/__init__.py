"""INTERFACE of the embedded agent: one typed tool for each capability that IDENTIFY found.

`stage.run(task)` groups the capabilities by name, looks each up in the catalog (one module per class of device, no
product in any of them), and says of every device that no tool serves why that is so.
"""

from octoform.builtin.interface.stage import run

__all__ = ["run"]
