"""What the daemon tells people and programs: its record of health, notices, metrics, and what a person can do."""
