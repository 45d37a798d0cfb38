"""Arms, hands and cameras."""
