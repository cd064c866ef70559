"""Watches over the flight that act or warn by themselves: texts only, no message of a client."""
