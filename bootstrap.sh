#!/usr/bin/env bash
# From a fresh machine to a live endpoint: sets up .venv, plans, applies with the embedded agent, calls one tool.
set -euo pipefail
cd "$(dirname "$0")"
.ci/setup
octoform=.venv/bin/octoform

echo "== octoform plan"
"$octoform" plan
echo
echo "== octoform apply"
"$octoform" apply -auto-approve
echo
tool=$("$octoform" tools --json | .venv/bin/python -c '
import json, sys
tools = json.load(sys.stdin)["tools"]
ready = [tool["name"] for tool in tools if tool["effect"] == "read" and not tool["input_schema"].get("required")]
print(ready[0] if ready else "")')
if [ -n "$tool" ]; then
    echo "== octoform call $tool"
    "$octoform" call "$tool"
fi
echo
echo "Next: put .venv/bin on your PATH, then: octoform plan"
