"""Element controller: the Skycontroller, the drones it knows, and its pilot's sticks."""
