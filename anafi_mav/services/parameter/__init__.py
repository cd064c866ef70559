"""The parameter protocol: the tables of parameters, their encoding and their description."""
