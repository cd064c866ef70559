"""Flight plans of the simulated drone: the store, the file's reader, and the camera items."""
