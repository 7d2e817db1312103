"""DEPLOY of the embedded agent: which exact packages the server needs, and what provides each import.

`stage.run(task)` reads the server's header and its imports, and lets the package tool (uv) choose versions that agree
for this interpreter. It installs nothing: octoform builds the environment, imports the server in it and calls its
tools, which is the better proof.
"""

from octoform.builtin.deploy.stage import run

__all__ = ["run"]
