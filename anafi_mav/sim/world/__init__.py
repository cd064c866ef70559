"""The simulated world: models, motion, wind, the radio link, and the faults injected into them."""
