"""The event protocol: the table of events, and their sequence for each client."""
