"""What was accepted: artifacts, copies, damage, instances, attempts, and what another host may reuse."""
