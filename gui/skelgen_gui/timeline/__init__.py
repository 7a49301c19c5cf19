"""The timeline and the curves below it: playing, a lane for each marker, residuals, angles of joints."""
