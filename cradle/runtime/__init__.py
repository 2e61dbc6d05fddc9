"""From arrays to the event loop and back, plain or compiled."""
