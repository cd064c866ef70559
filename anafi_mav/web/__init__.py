"""The gateway's web server: pages and files for browsers and ground stations, over HTTP."""
