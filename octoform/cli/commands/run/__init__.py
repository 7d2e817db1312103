"""Commands that plan and change: plan, apply, destroy, answers, attempts."""
