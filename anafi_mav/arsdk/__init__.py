"""Parrot's wire protocol for both of its ends, controller and device, in Parrot's words."""
