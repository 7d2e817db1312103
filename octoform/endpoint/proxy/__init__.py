"""The stdio command of every local client: messages to the endpoint's socket and back. Light."""
