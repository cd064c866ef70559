"""The command protocol: COMMAND_LONG and COMMAND_INT, and the handler of each MAV_CMD."""
