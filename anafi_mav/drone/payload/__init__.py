"""Elements of the payload: cameras, gimbal, thermal camera, storage and media."""
