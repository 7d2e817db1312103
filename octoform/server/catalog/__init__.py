"""What is offered to clients: tools, resources, and the notice when they change."""
