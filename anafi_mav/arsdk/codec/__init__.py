"""How ARSDK messages look in bytes: Parrot's own encoding, and protocol buffers. No I/O."""
