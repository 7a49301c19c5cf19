"""The open project and what happens to it: session, files, undo, corrections, jobs on other threads, recovery."""
