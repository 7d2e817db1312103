"""The daemon: notices what happens to a deployment, repairs what can be repaired, and says so when it cannot."""
