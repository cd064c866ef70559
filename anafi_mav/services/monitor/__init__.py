"""Watches over the flight that act or warn without a client's message."""
