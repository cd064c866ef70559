"""Elements that report state: identity, battery, position, link, alerts, home."""
