"""Read-only commands: state, devices, attempts and logs."""
