"""Rules for IDENTIFY's annotations: names, answers, capabilities."""
