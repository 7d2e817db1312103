"""Ways to run an agent on one task: one module for each harness, all of them below the same containment.

The port is `octoform.harness.port`; `octoform.harness.adapters.resolve` gives the harness that a manifest names, and
`octoform.harness.containment.orphans.sweep` ends what a crash left running.
"""
