"""One small module per class of device; each exports `claim(device) -> Claim | None` and names no product."""
