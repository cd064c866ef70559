"""The simulated world: models, motion, wind, the radio link, and injected faults."""
