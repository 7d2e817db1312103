"""Apply: executes a plan, one journalled step at a time; what a contract did not accept is never seen again."""
