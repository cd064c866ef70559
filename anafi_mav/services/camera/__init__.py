"""The camera component: information, settings, storages, photos and recordings."""
