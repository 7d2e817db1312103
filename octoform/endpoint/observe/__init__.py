"""What the endpoint is and did, seen from outside: its drift, its logs, when it was last seen."""
