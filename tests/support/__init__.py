"""What several tests need: a raw MAVLink client, and a simulated drone behind a gateway."""
