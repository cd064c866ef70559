"""The ARSDK link: discovery, handshake, frames, acknowledgement and retry, at both ends."""
