"""What is known and kept: state, devices, profiles, specs, and what the harnesses need."""
