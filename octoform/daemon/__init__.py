"""The daemon: notices what happens to a deployment, repairs what can be repaired, and reports when it cannot."""
