"""The ARSDK link: discovery, handshake, frames, acknowledgement and retry, for both of its ends."""
