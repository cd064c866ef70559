"""Elements that report the drone's condition: identity, battery, position, link, alerts, home."""
