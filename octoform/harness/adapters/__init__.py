"""One module for each harness; `octoform.harness.registry` imports the one that a manifest names."""
