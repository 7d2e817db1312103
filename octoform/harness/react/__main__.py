"""The agent's process: ``python -I -m octoform.harness.react CONFIG``, with the prompt where the configuration names.

The variables that no command may have come as a JSON object on standard input. What a process is started with anybody
of the same user can read, its commands first of all; what it sets itself cannot be seen there.
"""

import os
import stat
import sys
from pathlib import Path

from octoform.base import files
from octoform.harness.llm.client import LiteLLM, Patient, Refusal, Request
from octoform.harness.react.agent_tools import Shell, Toolbox
from octoform.harness.react.chat_history import Conversation
from octoform.harness.react.config import Config, read
from octoform.harness.react.loop import Loop, Reporter, instructions

UNAUTHORIZED = 401


def main(path: str) -> int:
    """Run the agent as the file states; 0 when its conversation came to an end of its own."""
    config = read(Path(path))
    os.environ.update(files.parse(sys.stdin.read() or "{}"))
    reporter = Reporter(sys.stdout)
    key = os.environ.get(config.route.key) if config.route.key else None
    if config.route.key and not key:
        reporter.problem(Refusal(f"the variable {config.route.key} with the API key is not set", UNAUTHORIZED), True)
        return 1
    environment = {name: value for name, value in os.environ.items() if name not in config.hidden}
    shell = Shell(Path(config.workdir), environment, config.shell_seconds, config.most_shell_seconds)
    request = Request(config.route, key, config.request_seconds, config.web_search, alive=reporter.alive)
    model = LiteLLM(request)
    task = files.read(Path(config.prompt)).decode("utf-8", "replace")
    loop = Loop(
        model=Patient(model, config.backoff_seconds, reporter.problem),
        toolbox=Toolbox(Path(config.workdir), shell, _secrets(config)),
        conversation=Conversation(instructions(config), task, model.input_tokens),
        reporter=reporter,
        done=lambda: _has_output(Path(config.output)),
        output=config.output,
    )
    return 0 if loop.run() else 1


def _secrets(config: Config) -> dict[str, str]:
    return {name: os.environ[name] for name in config.hidden if os.environ.get(name)}


def _has_output(output: Path) -> bool:
    """True when the declared output is there and not empty."""
    try:
        facts = output.lstat()
    except OSError:
        return False
    return stat.S_ISREG(facts.st_mode) and facts.st_size > 0


if __name__ == "__main__":
    status = main(sys.argv[1])
    sys.stdout.flush()
    # The libraries' own threads and exit handlers have nothing left to do, and some of them take their time.
    os._exit(status)
