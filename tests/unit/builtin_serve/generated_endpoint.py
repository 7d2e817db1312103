"""A generated server over the invented host, and calls of it as a client makes them."""

import asyncio
import importlib.util
import json
import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from unit.builtin_serve.invented_host import build, interface

from octoform import runtime
from octoform.builtin.serve.stage import render

Call = tuple[str, dict[str, Any]]


class Endpoint:
    """A generated server in a folder of its own, and the host that it sees."""

    def __init__(self, folder: Path, only: tuple[str, ...], process: bool = False) -> None:
        """With ``process`` a client starts it as a program, else it is imported here, which is much faster."""
        self.process = process
        self.root = folder / "root"
        self.tree = build(self.root)
        self.log = folder / "calls.jsonl"
        self.artifact = interface(only)
        self.environment = {
            **{"OCTOFORM_SYSROOT": str(self.root), "OCTOFORM_CALL_LOG": str(self.log), "PATH": os.defpath},
            **{"FASTMCP_CHECK_FOR_UPDATES": "off", "FASTMCP_ENV_FILE": os.devnull, "CV2_NOTES": str(folder / "cv2")},
        }
        self.folder = folder / "serve"
        shutil.copytree(Path(runtime.__file__).parent, self.folder / "runtime")
        (self.folder / "server.py").write_text(render(self.artifact))

    def calls(self, wanted: Sequence[Call], mode: str = "auto") -> list[Any]:
        """Results of some calls in one conversation; each good one is held against the tool's output_schema."""
        with pytest.MonkeyPatch.context() as patch:
            for name, value in self.environment.items():
                patch.setenv(name, value)
            patch.syspath_prepend(str(self.folder))
            return asyncio.run(self._calls(wanted, mode))

    async def _calls(self, wanted: Sequence[Call], mode: str) -> list[Any]:
        async with Client(self._server(), mode=mode) as client:
            results = [await client.call_tool(name, given, raise_on_error=False) for name, given in wanted]
        for (name, _), result in zip(wanted, results, strict=True):
            if not result.is_error:
                jsonschema.validate(result.structured_content, self.schema(name))
        return results

    def _server(self) -> Any:
        if self.process:
            command = [str(self.folder / "server.py")]
            return StdioTransport(sys.executable, command, env=self.environment, keep_alive=False)
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(sys.modules, "runtime", runtime)
            specification = importlib.util.spec_from_file_location("generated", self.folder / "server.py")
            assert specification is not None and specification.loader is not None
            module = importlib.util.module_from_spec(specification)
            specification.loader.exec_module(module)
        return module.mcp

    def data(self, wanted: Sequence[Call], mode: str = "auto") -> list[dict[str, Any]]:
        """Structured results of calls that must go well."""
        results = self.calls(wanted, mode)
        assert not any(result.is_error for result in results), [result.content for result in results]
        return [result.structured_content for result in results]

    def said(self, *wanted: Call) -> list[str]:
        """The texts of calls that must fail."""
        results = self.calls(wanted)
        assert all(result.is_error for result in results)
        return [result.content[0].text for result in results]

    def schema(self, name: str) -> Mapping[str, Any]:
        return next(tool["output_schema"] for tool in self.artifact["tools"] if tool["name"] == name)

    def logged(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.log.read_text().splitlines()]
