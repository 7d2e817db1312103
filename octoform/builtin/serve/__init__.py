"""SERVE of the embedded agent: one readable FastMCP server from the INTERFACE artifact.

`stage.run(task)` renders one template per class of device, only of the classes that the artifact names. Heavy: imports
jinja2.
"""

from octoform.builtin.serve.stage import run

__all__ = ["run"]
