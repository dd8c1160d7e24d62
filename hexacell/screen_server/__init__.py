"""The technician's screen in browsers: a server that starts a process of the screen for each page."""
